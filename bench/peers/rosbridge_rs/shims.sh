#!/bin/sh
# shims.sh VENV: what a program that is not Python misses in the wheels of ROS 2, in VENV/shims.
# They have one rmw and no librmw_implementation that would choose it, and libraries for Python's
# sake that only Python can load: of those, empty ones.
set -eu
mkdir -p "$1/shims"
ln -sf ../lib/librmw_fastrtps_cpp.so "$1/shims/librmw_implementation.so"
for library in "$1"/lib/*__rosidl_generator_py.so; do
    cc -shared -x c /dev/null -o "$1/shims/${library##*/}"
done
