"""RTAB-Map as a SLAM back end: the core inside the wheel `depthai`, driven in a process of its own.

`backend` is what a method sees: poses in the world, loops, the optimised trajectory. `settings` has RTAB-Map's
parameters, `library` finds the wheel and compiles `bridge.cpp`, the C interface to it, `worker` is the
process that loads both, and `protocol` what the two processes say to each other.
"""
