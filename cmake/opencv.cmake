# The parts of OpenCV that the rig's camera and boards of corners use: the target opencv_parts. Without OpenCV files of
# the same functions say that it is missing.
option(TOUCHSTONE_CAMERA "Build the rig's camera with OpenCV" ON)

if(TOUCHSTONE_CAMERA)
  # Debian's OpenCVConfig.cmake is in a package that wants all of OpenCV; these five parts are enough.
  find_path(OPENCV_INCLUDE_DIR opencv2/videoio.hpp PATH_SUFFIXES opencv4 REQUIRED)
  set(opencv_libraries)
  foreach(part calib3d videoio imgcodecs imgproc core)
    find_library(OPENCV_${part}_LIBRARY opencv_${part} REQUIRED)
    list(APPEND opencv_libraries ${OPENCV_${part}_LIBRARY})
  endforeach()
  add_library(opencv_parts INTERFACE)
  target_include_directories(opencv_parts SYSTEM INTERFACE ${OPENCV_INCLUDE_DIR})
  target_link_libraries(opencv_parts INTERFACE ${opencv_libraries})
endif()
