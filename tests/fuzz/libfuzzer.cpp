// For those who have clang; the build does not make it. From the repository root:
//   clang++ -std=c++17 -O1 -g -fsanitize=fuzzer,address,undefined -I. -o fuzz-frames \
//     tests/fuzz/libfuzzer.cpp tests/fuzz/frame_fuzz.cpp \
//     firmware/core/{debouncer,effector,frame,messages,ticks}.cpp && ./fuzz-frames -max_total_time=600
#include <cstdlib>

#include "tests/fuzz/frame_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  touchstone::fuzz::Counts counts;
  if (!touchstone::fuzz::CheckBytes(data, size, &counts).empty()) std::abort();
  return 0;
}
