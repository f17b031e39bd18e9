"""The map: a coloured point cloud and a mesh, built from the depth that is meant for the map (MDI) and any poses."""
