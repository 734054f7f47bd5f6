"""Files in and out: captures, normal maps, height maps, meshes, truth."""
