#include "server/diagnosis/selection/session/dropouts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/numbers/random.h"
#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::selection {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

// Contacts fall silent with a probability that depends on touch and finger.
template <typename Probability>
std::string WordsFor(Probability probability, uint64_t seed) {
  touches::SyntheticSet set(5, 48, 4, 0.005, 3);
  RandomStream random(seed, RandomDomain::kTest);
  for (int k = 0; k < set.observations.size(); ++k)
    for (int i = 0; i < 3; ++i)
      if (random.Uniform() < probability(set.observations, k, i))
        set.observations.time_s[static_cast<size_t>(k) * 3 + i] = NAN;
  return DropoutsInWords(set.observations, set.prediction);
}

TEST(Dropouts, AreNotWorthASentenceWhereChanceMissesThemEverywhere) {
  for (uint64_t seed = 0; seed < 20; ++seed)
    EXPECT_THAT(WordsFor([](const auto&, int, int) { return 0.05; }, seed), IsEmpty()) << seed;
}

TEST(Dropouts, OfOneFingerAreItsOwn) {
  EXPECT_THAT(WordsFor([](const auto&, int, int i) { return i == 2 ? 0.2 : 0.02; }, 1),
              HasSubstr("most often by finger r"));
}

TEST(Dropouts, OfOneObjectAreItsOwn) {
  EXPECT_THAT(WordsFor([](const auto& o, int k, int) { return o.object[k] == 3 ? 0.3 : 0.02; }, 2),
              HasSubstr("most often on object3"));
}

TEST(Dropouts, OfWholeRowsAreCounted) {
  EXPECT_THAT(WordsFor([](const auto&, int k, int) { return k < 552 ? 1 : 0; }, 3),
              HasSubstr("In 552 of 960 rows no finger reported."));
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
