"""Pictures of a detector's steps: any `detectors.steps.Step` as a figure, and all of a detection as a folder."""
