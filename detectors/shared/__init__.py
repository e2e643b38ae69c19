"""What several detectors use: cues, morphology, outlines, regularisation."""
