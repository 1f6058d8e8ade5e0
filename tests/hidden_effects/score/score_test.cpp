// The trial in small, on fixed seeds: about thirty sets over all arms.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hidden_effects/score/expect_always.h"

namespace touchstone::hidden {
namespace {

TEST(HiddenEffects, NothingHiddenIsNamedNothing) {
  ExpectAlways("nothing", 4, "false claim", false);
}

TEST(HiddenEffects, ABadPrintIsNotSoldAsPhysics) {
  ExpectAlways("bumps of 0.25 sigma", 2, "false claim", false);
  ExpectAlways("bumps of 0.5 sigma", 2, "false claim", false);
}

TEST(HiddenEffects, AreNamedFirst) {
  ExpectAlways("one", 5, "right first", true);
}

TEST(HiddenEffects, AreNamedFirstEvenIfWeak) {
  ExpectAlways("one weak", 4, "right first", true, 1);
}

TEST(HiddenEffects, HaveTheirValues) {
  ExpectAlways("one", 3, "within 3 standard errors", true);
}

TEST(HiddenEffects, AreAllFoundTogether) {
  ExpectAlways("two", 3, "all found, none added", true, 1);
}

TEST(HiddenEffects, ThatDataCannotTellApartAreNamedTogetherWithWhatDecides) {
  ExpectAlways("latency or length, one speed", 2, "said so, with what decides", true);
  ExpectAlways("stretched time", 2, "said so, with what decides", true);
}

TEST(HiddenEffects, ThatASecondSpeedTellsApartAreToldApart) {
  ExpectAlways("latency or length, two speeds", 2, "right first", true);
}

TEST(HiddenEffects, ThatNoCatalogueListsAreOwnedUp) {
  ExpectAlways("unlisted", 4, "wrong name instead", false, 1);
}

TEST(HiddenEffects, OfSetsWithoutPosesBlameNobody) {
  ExpectAlways("no poses", 2, "names a culprit", false);
}

TEST(HiddenEffects, AreNotMadeUpFromLossesAndOutliers) {
  ExpectAlways("20 % missing", 1, "false claim", false);
  ExpectAlways("2 % outliers", 1, "false claim", false);
  ExpectAlways("2 % outliers", 1, "owns up to gross errors", true);
}

TEST(TheModelsOwnValues, AreCorrectedWhereTheyAreWrong) {
  ExpectAlways("wrong value", 2, "says wrong values", true);
  ExpectAlways("wrong value", 1, "value right", true);
}

// The first experiment with such a rig: an ideal model against measurements with Gaussian noise of 0.04779.
TEST(TheSeedsOwnStory, IsThatNoiseIsMissing) {
  ExpectAlways("noise missing", 1, "noise named", true);
  ExpectAlways("noise missing", 1, "noise within 5 %", true);
  ExpectAlways("noise missing", 1, "histograms agree", true);
}

}  // namespace
}  // namespace touchstone::hidden
