// a machine foot: a plate with a round boss that is loaded at its top
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 0.7, 0.2};
Cylinder(2) = {0.4, 0.35, 0.1, 0, 0, 0.5, 0.22};
BooleanUnion(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
e = 1e-3;
Physical Surface("bottom") = Surface In BoundingBox {-e, -e, -e, 1 + e, 0.7 + e, e};
Physical Surface("top") = Surface In BoundingBox {-e, -e, 0.6 - e, 1 + e, 0.7 + e, 0.6 + e};
Physical Volume("body") = {3};
