"""Black box: the stand's wrench from motor forces and attitude, by networks and by honest rivals."""
