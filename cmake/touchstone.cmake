# Compiler flags and the three functions that every folder's CMakeLists.txt uses.

add_library(touchstone_flags INTERFACE)
target_include_directories(touchstone_flags INTERFACE
  $<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}> $<BUILD_INTERFACE:${CMAKE_BINARY_DIR}/generated>)
target_compile_features(touchstone_flags INTERFACE cxx_std_17)
# Macros name files from the root of the repository: an object is the same wherever a clone lies, and ccache finds it.
# -pthread, as gRPC and GoogleTest ask for, since what shares precompiled headers shares options.
# What an installed library's user inherits stands outside BUILD_INTERFACE: the instruction set, on which the alignment
# of Eigen's types depends, and no fused multiply-add, since the linker may keep the user's copy of an inline function.
target_compile_options(touchstone_flags INTERFACE
  "$<BUILD_INTERFACE:-Wall;-Wextra;-Wno-unused-parameter;-pthread>" -ffp-contract=off
  "$<BUILD_INTERFACE:-fmacro-prefix-map=${CMAKE_SOURCE_DIR}/=>")
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64" AND TOUCHSTONE_ARCH)
  target_compile_options(touchstone_flags INTERFACE -march=${TOUCHSTONE_ARCH})
endif()
if(TOUCHSTONE_CHANGEABLE_RULES)
  target_compile_definitions(touchstone_flags INTERFACE TOUCHSTONE_CHANGEABLE_RULES)
endif()

set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG")
set(CMAKE_C_FLAGS_RELEASE "-O3 -DNDEBUG")
set(CMAKE_CXX_FLAGS_DEBUG "-O0 -g1 -D_GLIBCXX_ASSERTIONS")
set(CMAKE_C_FLAGS_DEBUG "-O0 -g1")
# touchstone_precompile gives these to the targets of a set of headers. What computes most has no messages and is optimised
# in full. What has messages loses nothing by -O2, nor do tests and what calls services by -O1; they compile in four and in
# three fifths of the time.
set(TOUCHSTONE_MESSAGES_OPTIONS $<$<CONFIG:Release>:-O2>)
set(TOUCHSTONE_LIGHT_OPTIONS $<$<CONFIG:Release>:-O1>)
# GCC 12 takes a std::optional without a value for uninitialised memory at -O1.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  list(APPEND TOUCHSTONE_LIGHT_OPTIONS -Wno-maybe-uninitialized)
endif()
# Of tests without stubs, beside them.
set(TOUCHSTONE_TEST_OPTIONS)
if(TOUCHSTONE_SANITIZE MATCHES "address")
  list(APPEND TOUCHSTONE_TEST_OPTIONS -fno-sanitize=undefined -fno-sanitize-address-use-after-scope)
endif()
# Programs take the precompiled headers of libraries, which are position-independent.
set(CMAKE_CXX_COMPILE_OPTIONS_PIE -fPIC)
# GCC collects garbage each time that its memory has doubled; a twentieth of the time was spent on it.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  add_compile_options($<$<COMPILE_LANGUAGE:CXX>:--param=ggc-min-heapsize=1048576>)
endif()
set(CMAKE_CXX_FLAGS_SANITIZE "-O1 -g1 -fno-omit-frame-pointer -D_GLIBCXX_ASSERTIONS")
set(CMAKE_C_FLAGS_SANITIZE "-O1 -g1 -fno-omit-frame-pointer")
if(TOUCHSTONE_SANITIZE)
  add_compile_options(-fsanitize=${TOUCHSTONE_SANITIZE} -fno-sanitize-recover=all)
  # What the address sanitizer reports by itself; a quarter of the time to compile and to run was spent on it.
  if(TOUCHSTONE_SANITIZE MATCHES "address")
    add_compile_options(-fno-sanitize=null,object-size,vptr)
  endif()
  add_link_options(-fsanitize=${TOUCHSTONE_SANITIZE})
endif()

# Half a hundred programs are linked with all that they test: mold takes a tenth of the time that GNU ld takes.
find_program(MOLD mold)
if(MOLD AND NOT CMAKE_CROSSCOMPILING)  # GCC for another processor looks for one of that name
  add_link_options(-fuse-ld=mold)
endif()

find_program(CCACHE ccache)
if(CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE})
  set(CMAKE_C_COMPILER_LAUNCHER ${CCACHE})
endif()

# Files of a folder are compiled several at a time, so that what they include is read once for all of them. Names of
# files' own are therefore unique within a folder, as people who read it would have them. Off, a change of one file
# compiles that one alone; the step separate of deploy/test shows that files stand on their own.
option(TOUCHSTONE_UNITY "Compile the files of a folder several at a time" ON)
set(CMAKE_UNITY_BUILD_BATCH_SIZE 16)

# touchstone_library(NAME [SEPARATE] SOURCES a.cpp ... LINKS base geometry absl::status ...)
# makes the static library touchstone_NAME; a plain word in LINKS is a folder of this project. SEPARATE: its files
# use the same names, each for itself, and are compiled one by one.
function(touchstone_library name)
  cmake_parse_arguments(ARG "SEPARATE" "" "SOURCES;LINKS" ${ARGN})
  add_library(touchstone_${name} STATIC ${ARG_SOURCES})
  if(TOUCHSTONE_UNITY AND NOT ARG_SEPARATE)
    set_target_properties(touchstone_${name} PROPERTIES UNITY_BUILD ON)
  endif()
  touchstone_link(touchstone_${name} PUBLIC ${ARG_LINKS})
endfunction()

# What server/base/test_paths.h declares.
set(test_paths ${CMAKE_BINARY_DIR}/generated/test_paths.cpp)
file(CONFIGURE OUTPUT ${test_paths} CONTENT [[
#include "server/base/test_paths.h"
std::string touchstone::SourceDir() { return "@CMAKE_SOURCE_DIR@"; }
std::string touchstone::SharedData() { return "@CMAKE_SOURCE_DIR@/../shared/data"; }
]] @ONLY)
add_library(touchstone_test_paths STATIC ${test_paths})
target_link_libraries(touchstone_test_paths PRIVATE touchstone_flags)

# Sanitizers cost a factor of ten and more.
set(TOUCHSTONE_TEST_TIMEOUT_S 600)
if(TOUCHSTONE_SANITIZE)
  set(TOUCHSTONE_TEST_TIMEOUT_S 1800)
endif()

# touchstone_add_test(NAME [SECOND_TIER] [SHARDS n] [ENVIRONMENT A=b ...] COMMAND program argument ...): the ctest NAME, or
# NAME_1 to NAME_n, which run a part of its tests each, side by side. SECOND_TIER: deploy/test leaves it to deploy/test --all.
# The time of each single test stands in test-times/NAME.xml of the build.
function(touchstone_add_test name)
  cmake_parse_arguments(ARG "SECOND_TIER" "SHARDS" "ENVIRONMENT;COMMAND" ${ARGN})
  set(tests ${name})
  if(ARG_SHARDS)
    set(tests)
    foreach(shard RANGE 1 ${ARG_SHARDS})
      list(APPEND tests ${name}_${shard})
    endforeach()
  else()
    set(ARG_SHARDS 1)
  endif()
  set(index 0)
  foreach(test ${tests})
    add_test(NAME ${test} COMMAND ${ARG_COMMAND})
    # What has more shards takes longer, and begins first.
    set_tests_properties(${test} PROPERTIES TIMEOUT ${TOUCHSTONE_TEST_TIMEOUT_S} COST ${ARG_SHARDS} ENVIRONMENT
      "GTEST_TOTAL_SHARDS=${ARG_SHARDS};GTEST_SHARD_INDEX=${index};GTEST_OUTPUT=xml:${CMAKE_BINARY_DIR}/test-times/${test}.xml;${ARG_ENVIRONMENT}")
    if(ARG_SECOND_TIER)
      set_tests_properties(${test} PROPERTIES LABELS second_tier)
    endif()
    math(EXPR index "${index} + 1")
  endforeach()
endfunction()

# touchstone_test(NAME [SECOND_TIER] [SHARDS n] SOURCES a_test.cpp ... LINKS ...): one test program per folder, NAME_test, and
# its ctest as of touchstone_add_test.
function(touchstone_test name)
  cmake_parse_arguments(ARG "SECOND_TIER" "SHARDS" "SOURCES;LINKS" ${ARGN})
  add_executable(${name}_test ${ARG_SOURCES})
  # Fewer at a time than of a library: tests of a folder often give their data the same name.
  set_target_properties(${name}_test PROPERTIES UNITY_BUILD ${TOUCHSTONE_UNITY} UNITY_BUILD_BATCH_SIZE 6)
  touchstone_link(${name}_test PRIVATE ${ARG_LINKS} touchstone_test_paths GTest::gmock GTest::gtest_main)
  set(options)
  if(ARG_SECOND_TIER)
    list(APPEND options SECOND_TIER)
  endif()
  if(ARG_SHARDS)
    list(APPEND options SHARDS ${ARG_SHARDS})
  endif()
  touchstone_add_test(${name} ${options} COMMAND ${name}_test)
endfunction()

# touchstone_link(TARGET PUBLIC|PRIVATE links...)
function(touchstone_link target visibility)
  set_property(GLOBAL APPEND PROPERTY TOUCHSTONE_TARGETS ${target})
  target_link_libraries(${target} ${visibility} touchstone_flags)
  foreach(link ${ARGN})
    if(link MATCHES "^[a-z_]+$" AND NOT link MATCHES "^touchstone_")
      set(link touchstone_${link})
    endif()
    target_link_libraries(${target} ${visibility} ${link})
  endforeach()
endfunction()

# touchstone_links_of(RESULT TARGET): the targets that TARGET links, directly or through others, and itself.
function(touchstone_links_of result target)
  set(pending ${target})
  set(seen)
  while(pending)
    list(POP_FRONT pending one)
    if(one IN_LIST seen OR NOT TARGET ${one})
      continue()
    endif()
    list(APPEND seen ${one})
    foreach(property LINK_LIBRARIES INTERFACE_LINK_LIBRARIES)
      get_target_property(links ${one} ${property})
      if(links)
        list(APPEND pending ${links})
      endif()
    endforeach()
  endwhile()
  set(${result} ${seen} PARENT_SCOPE)
endfunction()
