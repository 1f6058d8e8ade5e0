#include "server/diagnosis/checks/mistakes.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/diagnosis/checks/rules.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::checks {
namespace {

struct Factor {
  double factor;  // what is in the file times this is right
  const char* words;
};

std::vector<std::vector<int>> FingerOrders(int fingers) {
  std::vector<int> order(fingers);
  std::iota(order.begin(), order.end(), 0);
  const std::vector<int> right = order;
  std::vector<std::vector<int>> orders;
  if (fingers <= kCheckRules.max_permuted) {
    while (std::next_permutation(order.begin(), order.end())) orders.push_back(order);
    return orders;
  }
  for (int i = 0; i < fingers; ++i)
    for (int j = i + 1; j < fingers; ++j) {
      order = right;
      std::swap(order[i], order[j]);
      orders.push_back(order);
    }
  for (int turn = 1; turn < fingers; ++turn) {
    order = right;
    std::rotate(order.begin(), order.begin() + turn, order.end());
    orders.push_back(order);
  }
  orders.push_back({right.rbegin(), right.rend()});
  return orders;
}

void AddFingerOrders(int fingers, std::vector<Mistake>* mistakes) {
  const auto name = [fingers](int finger) { return model::FingerName(finger, fingers); };
  for (const std::vector<int>& order : FingerOrders(fingers)) {
    std::vector<std::string> moved, holds;
    for (int i = 0; i < fingers; ++i) {
      if (order[i] == i) continue;
      moved.push_back(name(i));
      holds.push_back(name(order[i]));
    }
    Mistake mistake{ProblemKind::kFingerOrder, "", "", {}, {}};
    mistake.fix.finger_order = order;
    if (moved.size() == 2) {
      mistake.detail = absl::StrCat(moved[0], " <-> ", moved[1]);
      mistake.words =
          absl::StrCat("the time columns of the fingers ", moved[0], " and ", moved[1], " are exchanged");
    } else {
      const std::string columns = absl::StrJoin(moved, ", "), fingers_held = absl::StrJoin(holds, ", ");
      mistake.detail = absl::StrCat(columns, " hold ", fingers_held);
      mistake.words =
          absl::StrCat("the time columns ", columns, " hold the times of the fingers ", fingers_held);
    }
    mistakes->push_back(std::move(mistake));
  }
}

void AddReversals(std::vector<Mistake>* mistakes) {
  Mistake lateral{ProblemKind::kLateralReversed,
                  "lateral -> -lateral",
                  "the lateral vectors point from the last finger to the first",
                  {},
                  {}};
  lateral.fix.reverse_lateral = true;
  mistakes->push_back(lateral);
  Mistake approach{ProblemKind::kApproachReversed,
                   "approach -> -approach",
                   "the approach vectors point against the direction of motion",
                   {},
                   {}};
  approach.fix.reverse_approach = true;
  mistakes->push_back(approach);
  // A tool frame whose z axis points the other way.
  Mistake both{ProblemKind::kApproachReversed,
               "approach -> -approach, lateral -> -lateral",
               "approach and lateral vectors both point the wrong way",
               {},
               {}};
  both.fix.reverse_approach = both.fix.reverse_lateral = true;
  mistakes->push_back(both);
}

void AddUnitsOfTime(std::vector<Mistake>* mistakes) {
  static constexpr Factor kFactors[] = {{10, ""},  {100, ""},  {1000, "milliseconds"}, {1e6, "seconds"},
                                        {0.1, ""}, {0.01, ""}, {1e-3, "nanoseconds"},  {1e-6, "picoseconds"}};
  for (const Factor& factor : kFactors) {
    Mistake mistake{
        ProblemKind::kUnitsTime, absl::StrCat("times x ", FactorInWords(factor.factor)), "", {}, {}};
    const bool named = std::abs(std::log10(factor.factor)) >= 3;
    mistake.words = named ? absl::StrCat("the times are ", factor.words, ", not microseconds")
                          : absl::StrCat("the times are ",
                                         factor.factor < 1 ? FactorInWords(1 / factor.factor)
                                                           : FactorInWords(factor.factor),
                                         " times too ", factor.factor < 1 ? "large" : "small");
    mistake.fix.scale_times = factor.factor;
    mistakes->push_back(std::move(mistake));
  }
}

void AddSpeeds(std::vector<Mistake>* mistakes) {
  static constexpr Factor kFactors[] = {{0.5, "twice what the arm did"},
                                        {2, "half of what the arm did"},
                                        {1.0 / 60, "mm/min, not mm/s"},
                                        {60, "mm/s over 60"},
                                        {1000, "m/s, not mm/s"},
                                        {1e-3, "um/s, not mm/s"},
                                        {25.4, "inches/s, not mm/s"},
                                        {1 / 25.4, "1/25.4 of mm/s"},
                                        {10, "a tenth of what the arm did"},
                                        {0.1, "ten times what the arm did"},
                                        {100, "a hundredth of the arm's"},
                                        {0.01, "a hundred times the arm's"},
                                        {0.25, "four times what the arm did"},
                                        {4, "a quarter of what the arm did"},
                                        {0.2, "five times what the arm did"},
                                        {5, "a fifth of what the arm did"}};
  for (const Factor& factor : kFactors) {
    Mistake mistake{ProblemKind::kSpeedFactor,
                    absl::StrCat("speed x ", FactorInWords(factor.factor)),
                    absl::StrCat("the speeds of the file are ", factor.words),
                    {},
                    {}};
    mistake.fix.scale_speed = factor.factor;
    mistakes->push_back(std::move(mistake));
  }
}

void AddUnitsOfLength(std::vector<Mistake>* mistakes) {
  static constexpr Factor kFactors[] = {{1000, "metres"},
                                        {10, "centimetres"},
                                        {25.4, "inches"},
                                        {1e-3, "micrometres"},
                                        {0.1, "tenths of millimetres"},
                                        {1 / 25.4, "1/25.4 mm"}};
  for (const Factor& factor : kFactors) {
    const std::string text = FactorInWords(factor.factor);
    Mistake all{ProblemKind::kUnitsLength,
                absl::StrCat("targets, standoff and speed x ", text),
                absl::StrCat("targets, standoffs and speeds are in ", factor.words, ", not millimetres"),
                {},
                {}};
    all.fix.scale_targets = all.fix.scale_standoff = all.fix.scale_speed = factor.factor;
    Mistake lengths{ProblemKind::kUnitsLength,
                    absl::StrCat("targets and standoff x ", text),
                    absl::StrCat("targets and standoffs are in ", factor.words, ", not millimetres"),
                    {},
                    {}};
    lengths.fix.scale_targets = lengths.fix.scale_standoff = factor.factor;
    Mistake targets{ProblemKind::kUnitsLength,
                    absl::StrCat("targets x ", text),
                    absl::StrCat("the targets are in ", factor.words, ", not millimetres"),
                    {},
                    {}};
    targets.fix.scale_targets = factor.factor;
    Mistake standoff{ProblemKind::kUnitsLength,
                     absl::StrCat("standoff x ", text),
                     absl::StrCat("the standoffs are in ", factor.words, ", not millimetres"),
                     {},
                     {}};
    standoff.fix.scale_standoff = factor.factor;
    for (Mistake* mistake : {&targets, &lengths, &all, &standoff}) mistakes->push_back(std::move(*mistake));
  }
}

void AddShifts(std::vector<Mistake>* mistakes) {
  for (int size = 1; size <= kCheckRules.max_shift; ++size)
    for (const int shift : {size, -size}) {
      Mistake mistake{ProblemKind::kRowShift,
                      absl::StrCat(shift > 0 ? "+" : "", shift, size == 1 ? " row" : " rows"),
                      "",
                      {},
                      {}};
      mistake.words = absl::StrCat("the times of each row belong to the touch ", size == 1 ? "" : "two rows ",
                                   shift > 0 ? "after" : "before", " it");
      mistake.fix.shift_rows = shift;
      mistakes->push_back(std::move(mistake));
    }
}

// Every signed permutation of the axes but the right one: turned frames first, as they are likelier than mirrored ones,
// and those that leave z be before the others.
void AddFrames(std::vector<Mistake>* mistakes) {
  std::vector<std::pair<int, Mistake>> frames;
  int axis[3] = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
      for (int row = 0; row < 3; ++row) axes(row, axis[row]) = (signs >> row) & 1 ? -1 : 1;
      if (axes.isIdentity()) continue;
      const bool mirrored = axes.determinant() < 0;
      const std::string text = session::FormatAxes(axes);
      Mistake mistake{ProblemKind::kFrame, absl::StrCat("x,y,z -> ", text), "", {}, {}};
      mistake.words = absl::StrCat("targets and vectors are in a ", mirrored ? "mirrored" : "turned",
                                   " frame: the object's x, y, z are the file's ", text);
      mistake.fix.axes = axes;
      frames.emplace_back(2 * mirrored + (axes(2, 2) != 1), std::move(mistake));
    }
  } while (std::next_permutation(axis, axis + 3));
  std::stable_sort(frames.begin(), frames.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  for (auto& frame : frames) mistakes->push_back(std::move(frame.second));
}

}  // namespace

std::string FactorInWords(double factor) {
  return factor < 1 ? absl::StrFormat("1/%.6g", 1 / factor) : absl::StrFormat("%.7g", factor);
}

std::vector<Mistake> MistakesOfFiles(int fingers, double typical_speed_m_s) {
  std::vector<Mistake> mistakes;
  AddReversals(&mistakes);
  AddFingerOrders(fingers, &mistakes);
  if (typical_speed_m_s >= kCheckRules.slowest_m_s && typical_speed_m_s <= kCheckRules.fastest_m_s) {
    AddUnitsOfTime(&mistakes);
    AddSpeeds(&mistakes);
  } else {
    AddSpeeds(&mistakes);
    AddUnitsOfTime(&mistakes);
  }
  AddUnitsOfLength(&mistakes);
  AddShifts(&mistakes);
  AddFrames(&mistakes);
  return mistakes;
}

}  // namespace touchstone::diagnosis::checks
