"""What finds buildings: scene in, footprints out."""
