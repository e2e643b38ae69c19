"""The Dempster-Shafer detector: masses, cue maps, detector, trace and steps."""
