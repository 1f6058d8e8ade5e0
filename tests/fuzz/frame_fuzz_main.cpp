// touchstone-fuzz-frames [--seconds N] [--seed S]: damages conversations with the end effector's core for so
// long. The same seed makes the same conversations. Ends with 1 and the seed of the conversation if anything
// wrong was accepted.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <vector>

#include "tests/fuzz/frame_fuzz.h"

int main(int argc, char** argv) {
  double seconds = 5;
  uint64_t seed = 1;
  for (int i = 1; i < argc; i += 2) {
    if (i + 1 < argc && std::strcmp(argv[i], "--seconds") == 0) {
      seconds = std::atof(argv[i + 1]);
    } else if (i + 1 < argc && std::strcmp(argv[i], "--seed") == 0) {
      seed = std::strtoull(argv[i + 1], nullptr, 0);
    } else {
      std::fprintf(stderr, "touchstone-fuzz-frames: unknown option '%s'; [--seconds N] [--seed S]\n",
                   argv[i]);
      return 2;
    }
  }

  touchstone::fuzz::Counts counts;
  const auto began = std::chrono::steady_clock::now();
  const auto elapsed = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  };
  std::mt19937_64 random(seed);
  std::vector<uint8_t> bytes;
  do {
    for (int i = 0; i < 64; ++i, ++seed) {
      std::string wrong = touchstone::fuzz::CheckConversation(seed, &counts);
      if (wrong.empty()) {
        // Bytes without any sense, many of them zeros.
        bytes.resize(random() % 200);
        for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random() % 5 == 0 ? 0 : random() % 256);
        wrong = touchstone::fuzz::CheckBytes(bytes.data(), bytes.size(), &counts);
      }
      if (!wrong.empty()) {
        std::fprintf(stderr, "%s: --seed %llu\n", wrong.c_str(), static_cast<unsigned long long>(seed));
        return 1;
      }
    }
  } while (elapsed() < seconds);

  std::printf(
      "%llu inputs in %.0f s: %llu damaged frames turned down, %llu more with a right CRC-16 stopped by the "
      "CRC-32, %llu good frames, %llu events accepted, none of them wrong\n",
      static_cast<unsigned long long>(counts.inputs), elapsed(),
      static_cast<unsigned long long>(counts.damaged_frames),
      static_cast<unsigned long long>(counts.slipped_frames),
      static_cast<unsigned long long>(counts.good_frames), static_cast<unsigned long long>(counts.events));
  return counts.events > 0 && counts.damaged_frames > 0 ? 0 : 1;
}
