"""
Lines for SLAM systems that take a fixed number of straight, identified lines a frame.

A frame's arcs become lines of the undistorted image (:mod:`.undistorted`), of which a balanced
part is chosen (:mod:`.selection`) and numbered (:mod:`.numbering`); :mod:`.pace` says which frames
are due, and :mod:`.feed` joins them.
"""
