#include "server/base/numbers/random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <vector>

namespace touchstone {
namespace {

// numpy.random.Philox(counter=[6, 42, 3, 0], key=[123456789, 3]).random_raw(4); NumPy counts up before it
// draws.
TEST(RandomBlock, IsNumPysPhiloxBitForBit) {
  const auto words = RandomBlock(123456789, RandomDomain::kTouchNoise, 42, 3, 7);
  EXPECT_EQ(words[0], 13916713776070603951ull);
  EXPECT_EQ(words[1], 1572667221543939541ull);
  EXPECT_EQ(words[2], 11539153723553720947ull);
  EXPECT_EQ(words[3], 8310409588280869946ull);
}

TEST(FillNormals, DoesNotDependOnHowItIsCut) {
  std::vector<uint64_t> indices(1000);
  std::iota(indices.begin(), indices.end(), 5);
  std::vector<double> whole(3000), parts(3000);
  FillNormals(7, RandomDomain::kTest, indices.data(), 1000, 3, whole.data());
  for (int begin = 0; begin < 1000; begin += 7)
    FillNormals(7, RandomDomain::kTest, &indices[begin], std::min(7, 1000 - begin), 3, &parts[3 * begin]);
  EXPECT_EQ(whole, parts);
}

// The polynomials against the C library, over the very words that the deviates were made of.
TEST(FillNormals, IsBoxMullerToFourteenDigits) {
  std::vector<uint64_t> indices(20000);
  std::iota(indices.begin(), indices.end(), 0);
  std::vector<double> normals(indices.size() * 4);
  FillNormals(99, RandomDomain::kTest, indices.data(), indices.size(), 4, normals.data());
  for (size_t k = 0; k < indices.size(); ++k) {
    const auto words = RandomBlock(99, RandomDomain::kTest, k, 0, 0);
    for (int pair = 0; pair < 2; ++pair) {
      const double radius = std::sqrt(-2 * std::log(1 - UniformFromWord(words[2 * pair])));
      const double angle = 2 * M_PI * UniformFromWord(words[2 * pair + 1]);
      EXPECT_NEAR(normals[4 * k + 2 * pair], radius * std::cos(angle), 1e-14);
      EXPECT_NEAR(normals[4 * k + 2 * pair + 1], radius * std::sin(angle), 1e-14);
    }
  }
}

TEST(FillNormals, HasTheMomentsOfANormal) {
  const int n = 200000;
  std::vector<uint64_t> indices(n);
  std::iota(indices.begin(), indices.end(), 0);
  std::vector<double> x(n * 3);
  FillNormals(1, RandomDomain::kTest, indices.data(), n, 3, x.data());
  double mean = 0, square = 0, fourth = 0;
  for (double v : x) mean += v, square += v * v, fourth += v * v * v * v;
  EXPECT_NEAR(mean / x.size(), 0, 5 / std::sqrt(x.size()));
  EXPECT_NEAR(square / x.size(), 1, 5 * std::sqrt(2.0 / x.size()));
  EXPECT_NEAR(fourth / x.size(), 3, 5 * std::sqrt(96.0 / x.size()));
}

TEST(RandomStream, DomainsIndicesAndAttemptsAreIndependent) {
  RandomStream a(1, RandomDomain::kPose, 5), b(1, RandomDomain::kTest, 5), c(1, RandomDomain::kPose, 6),
      d(1, RandomDomain::kPose, 5, 1), again(1, RandomDomain::kPose, 5);
  const uint64_t word = a.Word();
  EXPECT_NE(word, b.Word());
  EXPECT_NE(word, c.Word());
  EXPECT_NE(word, d.Word());
  EXPECT_EQ(word, again.Word());
}

TEST(RandomStream, BelowStaysBelowAndCoversAll) {
  RandomStream stream(3, RandomDomain::kTest);
  std::vector<int> seen(7);
  for (int k = 0; k < 7000; ++k) ++seen.at(stream.Below(7));
  for (int count : seen) EXPECT_NEAR(count, 1000, 5 * std::sqrt(1000.0));
}

}  // namespace
}  // namespace touchstone
