"""Input of the detector: subscriptions, image messages as grey frames, region and mask."""
