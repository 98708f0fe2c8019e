# Builds the core for another system with Zig's Clang: packaging/wheels.py sets GLINT_ZIG_* (see there).
set(CMAKE_SYSTEM_NAME $ENV{GLINT_ZIG_SYSTEM})
set(CMAKE_SYSTEM_PROCESSOR $ENV{GLINT_ZIG_PROCESSOR})
set(CMAKE_CXX_COMPILER $ENV{GLINT_ZIG_PYTHON} -m ziglang c++)
set(CMAKE_CXX_COMPILER_TARGET $ENV{GLINT_ZIG_TARGET})  # CMake then looks at what Zig is without linking
set(GLINT_ZIG ON)
set(CMAKE_LINK_DEPENDS_USE_LINKER FALSE)
# Zig's default for code that is not optimised; the core has sanitizer builds of its own.
set(CMAKE_CXX_FLAGS_INIT -fno-sanitize=all)
set(CMAKE_SHARED_LINKER_FLAGS_INIT -Wl,-s)
# A test program that is linked would compile the C++ library a second time: minutes.
set(CMAKE_CXX_COMPILER_WORKS TRUE)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(THREADS_PREFER_PTHREAD_FLAG FALSE)
set(CMAKE_INSTALL_NAME_TOOL true)   # on macOS the library keeps the name that it is linked with
