"""A marked point process of rectangles: buildings from a point cloud alone (Yu, Li, Guan & Wang 2013)."""
