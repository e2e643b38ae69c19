"""How far an index of one comparison can be believed: intervals, redrawn references, and two detections paired."""
