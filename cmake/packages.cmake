# Debian packages of the components that are installed (cmake/install.cmake): cpack -G DEB, or deploy/package deb.
#   touchstone          the command line, the probe, the emulated rig, manual pages, completion
#   touchstone-server, touchstone-gateway   the services, with their units
#   touchstone-dev      static libraries and headers
#   python3-touchstone  the Python package, where TOUCHSTONE_WHEEL names its wheel
set(TOUCHSTONE_WHEEL "" CACHE FILEPATH "Wheel of client/python, for the package python3-touchstone; empty: none is made")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME touchstone)
set(CPACK_PACKAGE_CONTACT "Touchstone developers <touchstone@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "touches and photographs of objects, simulated or on a rig")
set(CPACK_PACKAGE_DESCRIPTION "Touchstone touches and photographs objects, simulated or with a UR arm, says what a
simulation lacks and how sure that is, and streams datasets.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_COMPONENTS_ALL runtime server gateway development)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# Folders as Debian has them, whatever the umask was.
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

# Drivers that are loaded by name (deploy/packages.txt, group run).
set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME touchstone)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_RECOMMENDS "touchstone-server, touchstone-gateway, libegl1, libegl-mesa0, libgl1-mesa-dri, libopengl0")
set(CPACK_COMPONENT_RUNTIME_DESCRIPTION "touches and photographs of objects: command line")
foreach(component server gateway)
  string(TOUPPER ${component} name)
  set(CPACK_DEBIAN_${name}_PACKAGE_NAME touchstone-${component})
  set(scripts ${CMAKE_CURRENT_BINARY_DIR}/packages/${component})
  set(unit touchstone-${component}.service)
  foreach(script postinst prerm postrm)
    file(CONFIGURE OUTPUT ${scripts}/${script} CONTENT "" @ONLY)
  endforeach()
  # A unit is there, and off: its administrator writes the options first. What it kept goes with a purge.
  file(WRITE ${scripts}/postinst "#!/bin/sh\nset -e\nif [ -d /run/systemd/system ]; then systemctl daemon-reload; fi\n")
  file(WRITE ${scripts}/prerm "#!/bin/sh\nset -e\nif [ -d /run/systemd/system ] && [ \"$1\" = remove ]; then systemctl stop ${unit} || true; fi\n")
  file(WRITE ${scripts}/postrm "#!/bin/sh\nset -e\nif [ \"$1\" = purge ]; then\n  if [ -d /run/systemd/system ]; then systemctl disable ${unit} 2> /dev/null || true; fi\n  rm -rf /var/lib/touchstone-${component} /var/lib/private/touchstone-${component}\nfi\nif [ -d /run/systemd/system ]; then systemctl daemon-reload; fi\n")
  file(CHMOD ${scripts}/postinst ${scripts}/prerm ${scripts}/postrm PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
  set(CPACK_DEBIAN_${name}_PACKAGE_CONTROL_EXTRA "${scripts}/postinst;${scripts}/prerm;${scripts}/postrm")
endforeach()
set(CPACK_DEBIAN_SERVER_PACKAGE_RECOMMENDS "libegl1, libegl-mesa0, libgl1-mesa-dri, libopengl0")
set(CPACK_COMPONENT_SERVER_DESCRIPTION "touches and photographs of objects: the simulation as a service")
set(CPACK_COMPONENT_GATEWAY_DESCRIPTION "touches and photographs of objects: the service before a rig")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME touchstone-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
# What a program that links the libraries needs: the libraries' own packages of deploy/packages.txt.
execute_process(COMMAND awk "/^\\[/ { inside = $1 == \"[build]\" } inside && $1 ~ /-dev$/ && !/gtest|gmock|benchmark/ { printf \"%s%s\", comma, $1; comma = \", \" }"
  ${CMAKE_CURRENT_SOURCE_DIR}/deploy/packages.txt OUTPUT_VARIABLE needed COMMAND_ERROR_IS_FATAL ANY)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "${needed}")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SHLIBDEPS OFF)
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "touches and photographs of objects: static libraries and headers")

if(TOUCHSTONE_WHEEL)
  list(APPEND CPACK_COMPONENTS_ALL python)
  # Its metadata go along: pip then knows that it is there.
  install(CODE "file(ARCHIVE_EXTRACT INPUT \"${TOUCHSTONE_WHEEL}\" DESTINATION \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/lib/python3/dist-packages\")" COMPONENT python EXCLUDE_FROM_ALL)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-touchstone)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS OFF)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3, python3-numpy, python3-grpcio, python3-protobuf")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS touchstone-server)
  # As Debian's own packages of Python: what the interpreter keeps beside the files goes with them.
  set(scripts ${CMAKE_CURRENT_BINARY_DIR}/packages/python)
  file(WRITE ${scripts}/postinst "#!/bin/sh\nset -e\nif [ \"$1\" = configure ] && command -v py3compile > /dev/null; then py3compile -p python3-touchstone; fi\n")
  file(WRITE ${scripts}/prerm "#!/bin/sh\nset -e\nif command -v py3clean > /dev/null; then py3clean -p python3-touchstone; fi\n")
  file(CHMOD ${scripts}/postinst ${scripts}/prerm PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA "${scripts}/postinst;${scripts}/prerm")
  set(CPACK_COMPONENT_PYTHON_DESCRIPTION "touches and photographs of objects: client for Python")
endif()
# Each package says under which licence it is, where Debian looks.
file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/packages/copyright "Copyright the authors of Touchstone.
Licensed under the Apache License, Version 2.0; on Debian its text is /usr/share/common-licenses/Apache-2.0.\n")
foreach(component ${CPACK_COMPONENTS_ALL})
  string(TOUPPER ${component} name)
  install(FILES ${CMAKE_CURRENT_BINARY_DIR}/packages/copyright COMPONENT ${component}
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${CPACK_DEBIAN_${name}_PACKAGE_NAME})
endforeach()
include(CPack)
