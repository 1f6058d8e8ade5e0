# Precompiled headers. Most of a file's compile time went into parsing the same headers again: gRPC and the generated
# messages are 300,000 lines, Eigen, CLI11 and GoogleTest 60,000 each. Four sets, each compiled once, serve every target:
# with the protocol or without it, for libraries or for tests. A file still includes all that it uses: the step tsan
# of deploy/test compiles without precompiled headers.
option(TOUCHSTONE_PRECOMPILE "Use precompiled headers" ON)

set(touchstone_core_headers
  <algorithm> <array> <atomic> <chrono> <cmath> <cstdint> <cstring> <functional> <limits> <map> <memory> <mutex>
  <numeric> <optional> <set> <string> <string_view> <thread> <utility> <variant> <vector>
  <absl/status/status.h> <absl/status/statusor.h> <absl/strings/str_cat.h> <absl/strings/str_format.h>
  <absl/strings/str_join.h> <absl/strings/str_split.h> <absl/types/span.h>
  <Eigen/Dense>)
set(touchstone_protocol_headers
  <touchstone/v1/types.pb.h> <touchstone/v1/source.grpc.pb.h> <touchstone/v1/control.grpc.pb.h>
  <touchstone/v1/models.grpc.pb.h> <touchstone/v1/sessions.grpc.pb.h> <touchstone/v1/diagnosis.grpc.pb.h>
  <touchstone/v1/rig.grpc.pb.h> <grpcpp/grpcpp.h> <google/protobuf/util/json_util.h>
  <nlohmann/json.hpp>)
set(touchstone_test_headers <gmock/gmock.h> <gtest/gtest.h>)

# touchstone_header_set(NAME headers...): the target touchstone_headers_NAME that others reuse.
function(touchstone_header_set name)
  set(target touchstone_headers_${name})
  set(source ${CMAKE_BINARY_DIR}/generated/headers_${name}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT "// Carries the precompiled headers '${name}'.\n")
  add_library(${target} OBJECT ${source})
  target_link_libraries(${target} PRIVATE touchstone_flags Eigen3::Eigen absl::statusor absl::strings)
  target_precompile_headers(${target} PRIVATE ${ARGN})
  if(CCACHE)
    set_target_properties(${target} PROPERTIES
      CXX_COMPILER_LAUNCHER "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/compile-header-set;${CCACHE}")
  endif()
endfunction()

# touchstone_precompile(): gives every target of touchstone_link its set.
# To be called last, when all links are known.
function(touchstone_precompile)
  if(NOT TOUCHSTONE_PRECOMPILE)
    return()
  endif()
  touchstone_header_set(core ${touchstone_core_headers})
  touchstone_header_set(core_test ${touchstone_core_headers} ${touchstone_test_headers})
  touchstone_header_set(protocol ${touchstone_core_headers} ${touchstone_protocol_headers})
  touchstone_header_set(protocol_test ${touchstone_core_headers} ${touchstone_protocol_headers}
    ${touchstone_test_headers})
  foreach(set core_test protocol_test)
    # Programs are compiled with -fPIE and libraries with -fPIC, which no precompiled header spans.
    target_link_libraries(touchstone_headers_${set} PRIVATE GTest::gmock GTest::gtest)
    set_target_properties(touchstone_headers_${set} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
    target_compile_options(touchstone_headers_${set} PRIVATE -fPIE ${TOUCHSTONE_TEST_OPTIONS})
  endforeach()
  foreach(set protocol protocol_test)
    target_link_libraries(touchstone_headers_${set} PRIVATE touchstone_proto nlohmann_json::nlohmann_json)
  endforeach()
  get_property(targets GLOBAL PROPERTY TOUCHSTONE_TARGETS)
  foreach(target ${targets})
    touchstone_links_of(links ${target})
    if(NOT touchstone_base IN_LIST links)
      continue()  # the firmware's core includes nothing but the standard library
    endif()
    get_target_property(type ${target} TYPE)
    if(touchstone_proto IN_LIST links)
      set(set protocol)
    else()
      set(set core)
    endif()
    if(type STREQUAL EXECUTABLE)
      if(NOT GTest::gtest IN_LIST links)
        continue()  # a main or a benchmark: one file
      endif()
      string(APPEND set _test)
    endif()
    target_precompile_headers(${target} REUSE_FROM touchstone_headers_${set})
  endforeach()
endfunction()
