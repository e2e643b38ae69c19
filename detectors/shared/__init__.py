"""What several detectors use: cues, morphology, regularised walls."""
