// Counter-based random streams: a draw is a pure function of (seed, domain, index, attempt), whatever the
// thread, the batch or the machine. Philox4x64-10 as in Random123 and NumPy: key = {seed, domain},
// counter = {block, index, attempt, 0}. Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", 2011.
#pragma once

#include <array>
#include <cstdint>

namespace touchstone {

// What a draw is for. Two purposes never share numbers. Values are part of the determinism promise.
enum class RandomDomain : uint64_t {
  kPose = 1,        // the pose of sample `index`
  kObject = 2,      // which object sample `index` shows
  kTouchNoise = 3,  // per-finger noise of touch `index`
  kMissedContact = 4,
  kPollPhase = 5,
  kSurfaceField = 6,  // the smooth error of an object's surface
  kImage = 7,
  kDiagnosis = 8,
  kNoiseMemory = 9,  // correlated noise of a finger in session time
  kModelDraw = 10,   // the model of sample `index`, where a posterior has many
  kTest = 1000,
};

// Four 64-bit words: block `block` of the stream (seed, domain, index, attempt).
std::array<uint64_t, 4> RandomBlock(uint64_t seed, RandomDomain domain, uint64_t index, uint64_t attempt,
                                    uint64_t block);

// [0, 1) with 52 random bits; the same in every place that turns a word into a real number.
double UniformFromWord(uint64_t word);

// Fills standard normal deviates for touches: normals[k * width + j], j < width, is the j-th deviate of
// stream (seed, domain, indices[k], attempt 0). Box-Muller on pairs of words with our own polynomials for
// log, sin and cos, so that the bits do not depend on the C library. Vectorises.
void FillNormals(uint64_t seed, RandomDomain domain, const uint64_t* indices, int count, int width,
                 double* normals);

// A stream for code that is not hot.
class RandomStream {
 public:
  RandomStream(uint64_t seed, RandomDomain domain, uint64_t index = 0, uint64_t attempt = 0)
      : seed_(seed), domain_(domain), index_(index), attempt_(attempt) {}

  uint64_t Word();
  double Uniform() { return UniformFromWord(Word()); }  // [0, 1)
  double Uniform(double lower, double upper) { return lower + (upper - lower) * Uniform(); }
  uint64_t Below(uint64_t bound);  // [0, bound)
  double Normal();                 // mean 0, sigma 1

 private:
  uint64_t seed_;
  RandomDomain domain_;
  uint64_t index_;
  uint64_t attempt_;
  uint64_t next_block_ = 0;
  int used_ = 4;
  std::array<uint64_t, 4> words_{};
};

}  // namespace touchstone
