"""Extension root: Blender imports this folder as a package and calls these two functions."""


def register():
    """Add the classes; imported here so that tests can import the root without bpy."""
    from .addon import registration

    registration.register()


def unregister():
    """Take the classes away again."""
    from .addon import registration

    registration.unregister()
