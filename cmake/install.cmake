# What `cmake --install` puts where, and the package that find_package(touchstone) finds. Components:
#   runtime      the command line, the probe, the emulated rig, meshes, the protocol, documents, manual pages, completion
#   server       touchstone-server and its systemd unit
#   gateway      touchstone-gateway and its systemd unit
#   development  static libraries, their headers, the package for CMake
# deploy/check-install tries all. cmake/packages.cmake makes a package of each.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(touchstone_programs
  touchstone touchstone-server touchstone-gateway touchstone-probe touchstone-rig-emulator)
# The library that links all others which are public.
set(touchstone_public touchstone_client_source)
set(touchstone_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/touchstone)

# touchstone_install(): to be called last, when all links are known.
function(touchstone_install)
  touchstone_install_runtime()
  touchstone_install_development()
endfunction()

function(touchstone_install_runtime)
  set(share ${CMAKE_INSTALL_DATADIR}/touchstone)
  foreach(program ${touchstone_programs})
    touchstone_component(component ${program})
    install(TARGETS ${program} RUNTIME COMPONENT ${component})
  endforeach()
  touchstone_documents()
  install(DIRECTORY meshes DESTINATION ${share} COMPONENT runtime)
  install(DIRECTORY proto/touchstone DESTINATION ${share}/proto COMPONENT runtime FILES_MATCHING PATTERN "*.proto")
  # At the time of installing: documents under the paths that their links name, without the folders that hold none; and
  # units with the path of the program, which is known then.
  string(CONFIGURE [=[
    set(source "@CMAKE_CURRENT_SOURCE_DIR@")
    set(documents LICENSE)
    foreach(pattern md png svg)
      file(GLOB top RELATIVE "${source}" "${source}/*.${pattern}")
      file(GLOB_RECURSE below RELATIVE "${source}" "${source}/proto/*.${pattern}" "${source}/server/*.${pattern}"
        "${source}/client/*.${pattern}" "${source}/firmware/*.${pattern}" "${source}/meshes/*.${pattern}"
        "${source}/deploy/*.${pattern}" "${source}/tests/*.${pattern}")
      list(APPEND documents ${top} ${below})
    endforeach()
    list(FILTER documents EXCLUDE REGEX "(^|/)([.]|node_modules/)")
    foreach(document ${documents})
      cmake_path(GET document PARENT_PATH folder)
      file(INSTALL "${source}/${document}" DESTINATION "${CMAKE_INSTALL_PREFIX}/@CMAKE_INSTALL_DOCDIR@/${folder}")
    endforeach()
  ]=] code @ONLY)
  install(CODE "${code}" COMPONENT runtime)
  foreach(component server gateway)
    string(CONFIGURE [=[
      set(unit touchstone-@component@.service)
      get_filename_component(prefix "${CMAKE_INSTALL_PREFIX}" ABSOLUTE)
      file(READ "@CMAKE_CURRENT_SOURCE_DIR@/deploy/systemd/${unit}" text)
      string(REPLACE "/usr/local/bin/" "${prefix}/@CMAKE_INSTALL_BINDIR@/" text "${text}")
      file(WRITE "@CMAKE_CURRENT_BINARY_DIR@/units/${unit}" "${text}")
      file(INSTALL "@CMAKE_CURRENT_BINARY_DIR@/units/${unit}" DESTINATION "${CMAKE_INSTALL_PREFIX}/lib/systemd/system")
    ]=] code @ONLY)
    install(CODE "${code}" COMPONENT ${component})
  endforeach()
endfunction()

# touchstone_component(RESULT PROGRAM)
function(touchstone_component result program)
  set(component runtime)
  if(program MATCHES "^touchstone-(server|gateway)$")
    set(component ${CMAKE_MATCH_1})
  endif()
  set(${result} ${component} PARENT_SCOPE)
endfunction()

# Manual pages and completion are asked of the programs, once they are built.
function(touchstone_documents)
  set(into ${CMAKE_CURRENT_BINARY_DIR}/documents)
  add_custom_command(OUTPUT ${into}.made
    COMMAND ${CMAKE_COMMAND} -D BIN=${CMAKE_RUNTIME_OUTPUT_DIRECTORY} -D INTO=${into} -P ${CMAKE_CURRENT_SOURCE_DIR}/cmake/documents.cmake
    COMMAND ${CMAKE_COMMAND} -E touch ${into}.made
    DEPENDS ${touchstone_programs} cmake/documents.cmake COMMENT "Manual pages and completion")
  add_custom_target(touchstone_documents ALL DEPENDS ${into}.made)
  install(DIRECTORY ${into}/share/ DESTINATION ${CMAKE_INSTALL_DATADIR} COMPONENT runtime OPTIONAL
    PATTERN "touchstone-server.1.gz" EXCLUDE PATTERN "touchstone-gateway.1.gz" EXCLUDE)
  foreach(component server gateway)
    install(FILES ${into}/share/man/man1/touchstone-${component}.1.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT ${component} OPTIONAL)
  endforeach()
endfunction()

# touchstone_folder(RESULT TARGET): the folder of its CMakeLists.txt, from the root of the repository.
function(touchstone_folder result target)
  get_target_property(folder ${target} SOURCE_DIR)
  cmake_path(RELATIVE_PATH folder BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
  set(${result} ${folder} PARENT_SCOPE)
endfunction()

function(touchstone_install_development)
  set(include ${CMAKE_INSTALL_INCLUDEDIR}/touchstone)
  set(libraries)
  set(folders)
  touchstone_links_of(linked ${touchstone_public})
  foreach(target ${linked})
    get_target_property(imported ${target} IMPORTED)
    if(NOT imported AND target MATCHES "^touchstone_(.*)")
      set_target_properties(${target} PROPERTIES EXPORT_NAME ${CMAKE_MATCH_1})
      list(APPEND libraries ${target})
      touchstone_folder(folder ${target})
      list(APPEND folders ${folder})
    endif()
  endforeach()
  install(TARGETS ${libraries} EXPORT touchstoneTargets ARCHIVE COMPONENT development INCLUDES DESTINATION ${include})

  # Headers of the libraries' folders and of the rooms in these, without those of tests and other targets that stand there:
  # they are named after a body of such a target, or as a test's.
  list(FILTER folders INCLUDE REGEX "^(server|client)/")
  list(REMOVE_DUPLICATES folders)
  get_property(others GLOBAL PROPERTY TOUCHSTONE_TARGETS)
  list(REMOVE_ITEM others ${libraries})
  foreach(target ${others})
    touchstone_folder(folder ${target})
    get_target_property(sources ${target} SOURCES)
    foreach(source ${sources})
      cmake_path(REPLACE_EXTENSION source LAST_ONLY .h)
      if(folder IN_LIST folders AND EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/${source})
        list(APPEND left_out PATTERN "${folder}/${source}" EXCLUDE)
      endif()
    endforeach()
  endforeach()
  foreach(folder ${folders})
    cmake_path(GET folder PARENT_PATH above)
    if(NOT above IN_LIST folders)
      install(DIRECTORY ${folder}/ DESTINATION ${include}/${folder} COMPONENT development
        FILES_MATCHING PATTERN "*.h" REGEX "[/_]test[_.][^/]*$" EXCLUDE PATTERN "testing" EXCLUDE ${left_out})
    endif()
  endforeach()
  install(DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/generated/ DESTINATION ${include} COMPONENT development
    FILES_MATCHING PATTERN "*.pb.h")

  install(EXPORT touchstoneTargets NAMESPACE touchstone:: DESTINATION ${touchstone_package_dir} COMPONENT development)
  configure_package_config_file(cmake/touchstoneConfig.cmake.in touchstoneConfig.cmake
    INSTALL_DESTINATION ${touchstone_package_dir} NO_SET_AND_CHECK_MACRO)
  # Before 1.0 a minor version may change what users call.
  write_basic_package_version_file(touchstoneConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  install(FILES ${CMAKE_CURRENT_BINARY_DIR}/touchstoneConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/touchstoneConfigVersion.cmake
      cmake/dependencies.cmake cmake/FindOpenCVParts.cmake
    DESTINATION ${touchstone_package_dir} COMPONENT development)
endfunction()
