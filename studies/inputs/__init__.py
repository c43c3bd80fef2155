"""What users give: designs, axes and studies, CSV tables, JSON lines."""
