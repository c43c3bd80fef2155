"""From readings back to the pose of the magnet: forward model, starting poses, iteration, observability."""
