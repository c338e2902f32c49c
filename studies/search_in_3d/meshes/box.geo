// a box; faces bottom and top
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 0.8, 0.5};
e = 1e-3;
Physical Surface("bottom") = Surface In BoundingBox {-e, -e, -e, 1 + e, 0.8 + e, e};
Physical Surface("top") = Surface In BoundingBox {-e, -e, 0.5 - e, 1 + e, 0.8 + e, 0.5 + e};
Physical Volume("body") = {1};
