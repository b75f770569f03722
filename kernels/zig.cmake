# Builds the kernels with Clang as the package ziglang has it: no compiler of the system is needed.
#
#     pip install ziglang
#     CMAKE_TOOLCHAIN_FILE=$PWD/kernels/zig.cmake pip install .
find_program(ZIG python-zig REQUIRED)
foreach(tool c++ ar ranlib)
  set(wrapper "${CMAKE_BINARY_DIR}/zig/${tool}")
  file(WRITE "${wrapper}" "#!/bin/sh\nexec \"${ZIG}\" ${tool} \"$@\"\n")
  file(CHMOD "${wrapper}" PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
endforeach()
set(CMAKE_CXX_COMPILER "${CMAKE_BINARY_DIR}/zig/c++")
set(CMAKE_AR "${CMAKE_BINARY_DIR}/zig/ar")
set(CMAKE_RANLIB "${CMAKE_BINARY_DIR}/zig/ranlib")
set(V3 "-march=x86_64_v3" CACHE STRING "")
