# The parts of OpenCV that the rig's camera and boards of corners use: the target opencv_parts. Without OpenCV files of
# the same functions say that it is missing.
# Debian's OpenCVConfig.cmake is in a package that wants all of OpenCV; these five parts are enough.
find_path(OPENCV_INCLUDE_DIR opencv2/videoio.hpp PATH_SUFFIXES opencv4)
set(opencv_libraries)
foreach(part calib3d videoio imgcodecs imgproc core)
  find_library(OPENCV_${part}_LIBRARY opencv_${part})
  list(APPEND opencv_libraries OPENCV_${part}_LIBRARY)
endforeach()

# OpenCV's core needs a BLAS, and of Debian's interchangeable ones OpenBLAS is the first choice. It starts its threads before
# main(), and with little address space (RLIMIT_AS) hangs there. The reference BLAS has none; a program that needs it itself
# has it loaded before OpenCV asks for one by the same name.
find_library(REFERENCE_BLAS_LIBRARY libblas.so.3 PATH_SUFFIXES ${CMAKE_LIBRARY_ARCHITECTURE}/blas blas)
find_library(REFERENCE_LAPACK_LIBRARY liblapack.so.3 PATH_SUFFIXES ${CMAKE_LIBRARY_ARCHITECTURE}/lapack lapack)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenCVParts REQUIRED_VARS OPENCV_INCLUDE_DIR ${opencv_libraries} REFERENCE_BLAS_LIBRARY REFERENCE_LAPACK_LIBRARY)
if(OpenCVParts_FOUND AND NOT TARGET opencv_parts)
  add_library(opencv_parts INTERFACE IMPORTED)
  set_target_properties(opencv_parts PROPERTIES INTERFACE_INCLUDE_DIRECTORIES ${OPENCV_INCLUDE_DIR})
  foreach(library ${opencv_libraries})
    set_property(TARGET opencv_parts APPEND PROPERTY INTERFACE_LINK_LIBRARIES ${${library}})
  endforeach()
  get_filename_component(blas_folder ${REFERENCE_BLAS_LIBRARY} DIRECTORY)
  get_filename_component(lapack_folder ${REFERENCE_LAPACK_LIBRARY} DIRECTORY)
  set_target_properties(opencv_parts PROPERTIES INTERFACE_LINK_OPTIONS
    "SHELL:-Wl,--push-state,--no-as-needed ${REFERENCE_BLAS_LIBRARY} ${REFERENCE_LAPACK_LIBRARY} -Wl,--pop-state;LINKER:-rpath,${blas_folder}:${lapack_folder}")
endif()
