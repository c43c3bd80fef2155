"""The parts that are sold, and what is required of a sensor: catalogues, requirements, and tolerances that follow."""
