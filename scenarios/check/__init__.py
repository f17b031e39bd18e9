"""Whether the truth of a scenario explains itself: depth, poses, flow, ids, normals, velocities and keypoints."""
