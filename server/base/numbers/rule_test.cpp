#include "server/base/numbers/rule.h"

#include <gtest/gtest.h>

namespace touchstone {
namespace {

struct TestRules {
  Rule<double> gain{"some.gain", 4.5, "nats", "A step gains more.", "Argument.", "Not measured."};
  Rule<int> max_steps{"some.max_steps", 12, "", "A search takes no more steps.", "Argument.",
                      "Not measured."};
  Rule<size_t> max_named{"some.max_named", 3, "", "No more are named.", "Argument.", "Not measured."};
};
inline constexpr TestRules kTestRules;

TEST(Rule, IsItsNumber) {
  EXPECT_GT(5.0, kTestRules.gain);
  EXPECT_EQ(2 * kTestRules.gain, 9);
  EXPECT_EQ(std::vector<int>(kTestRules.max_steps).size(), 12u);
  EXPECT_EQ(std::min<size_t>(7, kTestRules.max_named), 3u);
}

TEST(Rule, IsListedInTheOrderOfItsStruct) {
  const std::vector<Rule<double>> rows = ListRules(kTestRules);
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_STREQ(rows[0].name, "some.gain");
  EXPECT_EQ(rows[1].number, 12);
  EXPECT_STREQ(rows[2].decides, "No more are named.");
}

}  // namespace
}  // namespace touchstone
