"""Collision along the whole motion, against the part as far as it is printed at that moment.

`scene` turns a profile into arrays, `solids` measures distances to convex bodies, `material` is what stands on the bed,
`sweep` walks through the motion.
"""
