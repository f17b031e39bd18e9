"""What a camera does to perfect images."""
