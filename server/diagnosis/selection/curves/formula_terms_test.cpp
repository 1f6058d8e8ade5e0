#include "server/diagnosis/selection/curves/formula_terms.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/selection/simulated_test_search.h"

namespace touchstone::diagnosis::selection {
namespace {

using ::testing::HasSubstr;

// The best term for a rig with this formula hidden.
FormulaTerm BestTerm(const std::string& expression, const std::string& k) {
  const TestSearch search = PrepareTestSearch({{"formula",
                                                {"name=odd", "adds=travel_mm", "expression=" + expression,
                                                 "k=" + k, "k_unit=1", "k_min=-9", "k_max=9"}}});
  return ScoreTerms(search.workspace->experiment, *search.workspace->rows, search.fit, search.details)[0];
}

TEST(FormulaTerms, FindADirectionThatOneFingerDependsOn) {
  const FormulaTerm term = BestTerm("k*(finger==0)*approach_z", "0.4");
  EXPECT_EQ(term.covariate, "approach_z");
  EXPECT_THAT(term.expression, HasSubstr("(finger == 0)"));
  EXPECT_NEAR(term.values[0], 0.4, 0.05);
}

TEST(FormulaTerms, FindAPeriodInTheTravel) {
  const FormulaTerm term = BestTerm("k*sin(2*pi*travel_mm/7)", "0.3");
  EXPECT_EQ(term.covariate, "travel_mm");
  EXPECT_THAT(term.expression, HasSubstr("lead"));
  EXPECT_NEAR(term.values[1], 7, 0.4);
}

TEST(FormulaTerms, FindAConditionFarFromZero) {
  const FormulaTerm term = BestTerm("k*finger*(session_time_s-1900)/1000", "0.4");
  EXPECT_EQ(term.covariate, "session_time_s");
}

TEST(FormulaTerms, AreEffectsThatAModelCanHold) {
  const FormulaTerm a = BestTerm("k*(finger==0)*approach_z", "0.4");
  EXPECT_TRUE(MakeTermEffect("rest", a).ok());
  FormulaTerm b = a;
  b.expression = "k * sin(2*pi*travel_mm/lead + phase)";
  b.parameters = {a.parameters[0], a.parameters[0], a.parameters[0]};
  b.parameters[1].name = "lead", b.parameters[2].name = "phase";
  b.values = {0.1, 0.5, 0.5};
  const FormulaTerm sum = Sum(a, b);
  EXPECT_THAT(sum.expression, HasSubstr("k2 * sin(2*pi*travel_mm/lead2 + phase2)"));
  EXPECT_TRUE(MakeTermEffect("rest", sum).ok()) << MakeTermEffect("rest", sum).status();
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
