# Precompiled headers. Most of a file's compile time went into parsing the same headers again: gRPC and the generated
# messages are 300,000 lines, Eigen, CLI11 and GoogleTest 60,000 each. Four sets, each compiled once, serve every target:
#
#   core      libraries without messages
#   messages  libraries with messages
#   tests     tests without stubs
#   calls     everything with stubs of the services: libraries, programs and tests. Each file that sees the stubs spends
#             two seconds on them, whether it uses them or not
#
# A file still includes all that it uses: the step separate of deploy/test compiles without precompiled headers.
option(TOUCHSTONE_PRECOMPILE "Use precompiled headers" ON)

set(touchstone_core_headers
  <algorithm> <array> <atomic> <chrono> <cmath> <cstdint> <cstring> <functional> <limits> <map> <memory> <mutex>
  <numeric> <optional> <set> <string> <string_view> <thread> <utility> <variant> <vector>
  <absl/status/status.h> <absl/status/statusor.h> <absl/strings/str_cat.h> <absl/strings/str_format.h>
  <absl/strings/str_join.h> <absl/strings/str_split.h> <absl/types/span.h>
  <Eigen/Dense>)
set(touchstone_messages_headers
  <touchstone/v1/types.pb.h> <touchstone/v1/source.pb.h> <touchstone/v1/control.pb.h> <touchstone/v1/models.pb.h>
  <touchstone/v1/sessions.pb.h> <touchstone/v1/diagnosis.pb.h> <touchstone/v1/rig.pb.h> <google/protobuf/util/json_util.h>
  <nlohmann/json.hpp>)
set(touchstone_tests_headers <gmock/gmock.h> <gtest/gtest.h>)
set(touchstone_calls_headers
  <touchstone/v1/source.grpc.pb.h> <touchstone/v1/control.grpc.pb.h> <touchstone/v1/models.grpc.pb.h>
  <touchstone/v1/sessions.grpc.pb.h> <touchstone/v1/diagnosis.grpc.pb.h> <touchstone/v1/rig.grpc.pb.h> <grpcpp/grpcpp.h>)

# touchstone_header_set(NAME parts...): the target touchstone_headers_NAME that others reuse, of the headers of these parts.
function(touchstone_header_set name)
  set(target touchstone_headers_${name})
  set(source ${CMAKE_BINARY_DIR}/generated/headers_${name}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT "// Carries the precompiled headers '${name}'.\n")
  add_library(${target} OBJECT ${source})
  target_link_libraries(${target} PRIVATE touchstone_flags Eigen3::Eigen absl::statusor absl::strings)
  foreach(part ${ARGN})
    target_precompile_headers(${target} PRIVATE ${touchstone_${part}_headers})
    target_link_libraries(${target} PRIVATE ${touchstone_${part}_links})
  endforeach()
  target_compile_options(${target} PRIVATE ${touchstone_${name}_options})
  if(CCACHE)
    set_target_properties(${target} PROPERTIES
      CXX_COMPILER_LAUNCHER "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/compile-header-set;${CCACHE}")
  endif()
endfunction()

# touchstone_precompile(): gives every target of touchstone_link its set, and the options of the set
# (cmake/touchstone.cmake). To be called last, when all links are known.
function(touchstone_precompile)
  set(touchstone_messages_links touchstone_proto_messages nlohmann_json::nlohmann_json)
  set(touchstone_tests_links GTest::gmock GTest::gtest)
  set(touchstone_calls_links touchstone_proto)
  set(touchstone_messages_options ${TOUCHSTONE_MESSAGES_OPTIONS})
  set(touchstone_tests_options ${TOUCHSTONE_LIGHT_OPTIONS} ${TOUCHSTONE_TEST_OPTIONS})
  # Defined as GoogleTest does: a precompiled header serves what has the same definitions.
  set(touchstone_calls_options ${TOUCHSTONE_LIGHT_OPTIONS} -DGTEST_HAS_PTHREAD=1)
  if(TOUCHSTONE_PRECOMPILE)
    touchstone_header_set(core core)
    touchstone_header_set(messages core messages)
    touchstone_header_set(tests core messages tests)
    touchstone_header_set(calls core messages calls tests)
  endif()
  get_property(targets GLOBAL PROPERTY TOUCHSTONE_TARGETS)
  foreach(target ${targets})
    touchstone_links_of(links ${target})
    get_target_property(type ${target} TYPE)
    if(touchstone_proto IN_LIST links)
      set(set calls)
    elseif(type STREQUAL EXECUTABLE AND GTest::gtest IN_LIST links)
      set(set tests)
    elseif(touchstone_proto_messages IN_LIST links)
      set(set messages)
    else()
      set(set core)
    endif()
    target_compile_options(${target} PRIVATE ${touchstone_${set}_options})
    # The firmware's core includes nothing but the standard library.
    if(TOUCHSTONE_PRECOMPILE AND touchstone_base IN_LIST links)
      target_precompile_headers(${target} REUSE_FROM touchstone_headers_${set})
    endif()
  endforeach()
endfunction()
