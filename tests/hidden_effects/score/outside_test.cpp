// What used to be confidently wrong outside the catalogue, one set each: right where a right answer is defined, and never
// sure of what is not so.
#include <gtest/gtest.h>

#include "tests/hidden_effects/score/expect_always.h"

namespace touchstone::hidden {
namespace {

void ExpectRight(const char* arm) {
  ExpectAlways(arm, 1, "right", true);
}

void ExpectHonest(const char* arm) {
  ExpectAlways(arm, 1, "confidently wrong", false);
  ExpectAlways(arm, 1, "honest", true);
}

TEST(OutsideTheCatalogue, AnErrorPeriodicInSessionTimeIsUnexplainedByTime) {
  ExpectRight("session wave, realistic");
  ExpectRight("session wave, strong");
}

TEST(OutsideTheCatalogue, NoiseWithMemoryIsCalledThat) {
  ExpectRight("noise with memory, strong");
}

TEST(OutsideTheCatalogue, ARandomWalkIsNoDrift) {
  ExpectRight("random walk, strong");
}

TEST(OutsideTheCatalogue, AWarmUpThatLevelsOffIsUnexplainedByTime) {
  ExpectRight("warm-up, realistic");
}

TEST(OutsideTheCatalogue, AnOffsetThatBeginsInMidSessionIsUnexplainedByTime) {
  ExpectRight("mid-session offset, realistic");
}

TEST(OutsideTheCatalogue, AWaveInIncidenceIsNoBadPrint) {
  ExpectRight("incidence wave, strong");
}

TEST(OutsideTheCatalogue, ACouplingBetweenFingersIsNoBadPrint) {
  ExpectHonest("finger coupling, strong");
}

TEST(OutsideTheCatalogue, AnEffectOnOneObjectIsSaidToBeThere) {
  ExpectRight("slip on one object, strong");
  ExpectRight("push on one object, strong");
}

TEST(OutsideTheCatalogue, AnEffectOnOneObjectIsNotCalledOneOfTheRig) {
  ExpectHonest("slip on one object, strong");
  ExpectHonest("push on one object, strong");
}

TEST(OutsideTheCatalogue, ObjectsThatAreRemountedAreNoNoise) {
  ExpectHonest("remounted each round, strong");
}

TEST(OutsideTheCatalogue, ErrorsOfEachPoseAreNoBadPrint) {
  ExpectHonest("error of each pose, strong");
}

TEST(OutsideTheCatalogue, AReversedLateralIsAMistakeInTheFile) {
  ExpectRight("lateral reversed, strong");
}

TEST(OutsideTheCatalogue, FingersInAnotherOrderAreAMistakeInTheFile) {
  ExpectRight("fingers permuted, strong");
}

TEST(OutsideTheCatalogue, ObjectsWithEachOthersNamesAreAMistakeInTheFile) {
  ExpectRight("objects swapped, strong");
}

TEST(OutsideTheCatalogue, TimesInOtherUnitsAreAMistakeInTheFile) {
  ExpectRight("time units, strong");
}

TEST(OutsideTheCatalogue, ASpeedThatWasDoubledIsAMistakeInTheFile) {
  ExpectRight("speed factor, strong");
}

TEST(OutsideTheCatalogue, AnObjectThatStandsLowerIsAMistakeInTheFile) {
  ExpectRight("object lower, strong");
}

TEST(OutsideTheCatalogue, CopiesUnderNewNumbersAreAMistakeInTheFile) {
  ExpectRight("copies, strong");
}

TEST(OutsideTheCatalogue, AValueBeyondItsBoundIsNoBadPrint) {
  ExpectHonest("beyond its bound, realistic");
}

TEST(OutsideTheCatalogue, AValueBeyondWhatRigsShowIsSaidToBeThat) {
  ExpectRight("beyond its bound, weak");
  ExpectRight("beyond its bound, strong");
}

TEST(OutsideTheCatalogue, AnOldValueCompetesWithANewEffect) {
  ExpectRight("old value wrong, realistic");
}

// Not met yet: noise that the model claims and the data do not have passes as ADEQUATE.
TEST(OutsideTheCatalogue, DISABLED_NoiseThatIsNotThereIsSaid) {
  ExpectRight("polling that is not there, strong");
  ExpectRight("tails that are not there, strong");
}

TEST(OutsideTheCatalogue, ABadPrintClaimsNoFallThatNobodyGetsAgain) {
  ExpectAlways("bad print, realistic", 1, "confidently wrong", false);
}

TEST(OutsideTheCatalogue, AFewTouchesAreTooLittle) {
  ExpectRight("1 touch, strong");
  ExpectRight("6 touches, strong");
}

}  // namespace
}  // namespace touchstone::hidden
