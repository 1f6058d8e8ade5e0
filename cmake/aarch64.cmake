# Toolchain file: builds for 64-bit ARM on another machine, with Debian's cross compiler and the libraries of a Debian 12
# root for arm64 that was only unpacked (deploy/arm64 makes it). What is built runs in QEMU's user mode.
#   cmake --preset release -B build/arm64 --toolchain cmake/aarch64.cmake -DTOUCHSTONE_SYSROOT=DIR
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(TOUCHSTONE_SYSROOT "" CACHE PATH "Root of Debian 12 for arm64 with the [build] packages of deploy/packages.txt")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES TOUCHSTONE_SYSROOT)
set(CMAKE_SYSROOT ${TOUCHSTONE_SYSROOT})
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64-static -L ${TOUCHSTONE_SYSROOT})
# Programs (protoc, npm) are this machine's, libraries the other's.
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${TOUCHSTONE_SYSROOT})
set(ENV{PKG_CONFIG_LIBDIR} ${TOUCHSTONE_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${TOUCHSTONE_SYSROOT}/usr/share/pkgconfig)
