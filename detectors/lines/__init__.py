"""Line detectors: buildings from straight edges of what the laser cannot see through (2010 and 2011 papers)."""
