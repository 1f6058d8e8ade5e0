# The parts of OpenCV that the rig's camera and boards of corners use: the target opencv_parts. Without OpenCV files of
# the same functions say that it is missing.
# Debian's OpenCVConfig.cmake is in a package that wants all of OpenCV; these five parts are enough.
find_path(OPENCV_INCLUDE_DIR opencv2/videoio.hpp PATH_SUFFIXES opencv4)
set(opencv_libraries)
foreach(part calib3d videoio imgcodecs imgproc core)
  find_library(OPENCV_${part}_LIBRARY opencv_${part})
  list(APPEND opencv_libraries OPENCV_${part}_LIBRARY)
endforeach()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenCVParts REQUIRED_VARS OPENCV_INCLUDE_DIR ${opencv_libraries})
if(OpenCVParts_FOUND AND NOT TARGET opencv_parts)
  add_library(opencv_parts INTERFACE IMPORTED)
  set_target_properties(opencv_parts PROPERTIES INTERFACE_INCLUDE_DIRECTORIES ${OPENCV_INCLUDE_DIR})
  foreach(library ${opencv_libraries})
    set_property(TARGET opencv_parts APPEND PROPERTY INTERFACE_LINK_LIBRARIES ${${library}})
  endforeach()
endif()
