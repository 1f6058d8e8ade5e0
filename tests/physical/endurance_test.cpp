// A few hundred touches while things break at random. RESULTS.md tells of many more.
#include "tests/physical/endurance/endurance.h"
#include "server/base/test_tier.h"

namespace touchstone {
namespace {

TEST(EnduranceTest, NothingIsLostDoubledOrAttributedToAnotherTouchWhateverBreaks) {
  EnduranceOptions options;
  // The rest is of the second tier: long.
  options.touches = SecondTierRuns() ? 200 : 60;
  options.fault_share = 0.1;
  Endurance endurance(options);
  const EnduranceReport report = endurance.Run();
  EXPECT_TRUE(report.Sound()) << report.Text();
  EXPECT_EQ(report.done, options.touches);
  EXPECT_GT(report.failed, 0u) << "nothing broke: " << report.Text();
  EXPECT_GT(report.repeats, 0u);
}

}  // namespace
}  // namespace touchstone
