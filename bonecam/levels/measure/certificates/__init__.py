"""What holds everywhere on the levels, also between the points that `levels.measure.inspection` measures at:
depth, nesting and stock, bounded by convex hulls.

A level is a bicubic polynomial patch on every element of the T-mesh (its weights are all one), and so is each
half of a patch. A patch lies in the hull of its 16 Bezier control points, its net. So a convex function is
nowhere on the patch larger than at one of them. `depth` bounds how deep a cut is; `certify` bounds nesting, how far
a level is out of the stock, or inside it, and the last cut, and certifies all cuts.

Sums are in floating point; `accuracy.ROUNDING` is added for it. What cannot be bounded within a tolerance has
the bound that was found.
"""
