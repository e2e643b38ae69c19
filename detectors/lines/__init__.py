"""Line detectors: buildings from straight edges of areas without ground points (2010 and 2011 papers)."""
