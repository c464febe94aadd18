"""What a person touches inside Blender: properties, operators, panels."""
