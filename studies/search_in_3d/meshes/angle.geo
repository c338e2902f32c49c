// an angle plate: an L that stands on one side
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 0.6, 0.2};
Box(2) = {0, 0, 0, 0.25, 0.6, 0.9};
BooleanUnion(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
e = 1e-3;
Physical Surface("bottom") = Surface In BoundingBox {-e, -e, -e, 1 + e, 0.6 + e, e};
Physical Surface("top") = Surface In BoundingBox {-e, -e, 0.9 - e, 0.25 + e, 0.6 + e, 0.9 + e};
Physical Volume("body") = {3};
