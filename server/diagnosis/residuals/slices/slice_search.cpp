#include "server/diagnosis/residuals/slices/slice_search.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/text/text.h"
#include "server/diagnosis/residuals/slices/rules.h"

namespace touchstone::diagnosis::residuals {
namespace {

// The smallest of 1, 2 or 5 times a power of ten that is at least `step`.
double ReadableStep(double step) {
  const double power = std::pow(10, std::floor(std::log10(step)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= step * (1 - 1e-9)) return factor * power;
  return 10 * power;
}

using Sums = SliceSums;

// Ranges of bins that one condition may take: every category or level, or all beyond a threshold.
std::vector<std::pair<int, int>> Ranges(const SliceBins& bins) {
  std::vector<std::pair<int, int>> ranges;
  if (bins.category()) {
    for (int b = 0; b < bins.count(); ++b) ranges.emplace_back(b, b);
  } else {
    for (int b = 1; b < bins.count(); ++b) {
      ranges.emplace_back(0, b - 1);
      ranges.emplace_back(b, bins.count() - 1);
    }
  }
  return ranges;
}

}  // namespace

void SliceSums::operator+=(const SliceSums& other) {
  count += other.count;
  excess += other.excess;
  residual += other.residual;
}

SliceSums SliceSums::operator-(const SliceSums& other) const {
  return {count - other.count, excess - other.excess, residual - other.residual};
}

double SliceScore(const SliceSums& slice, const SliceSums& all) {
  const double share = slice.count / all.count;
  const double apart = slice.residual - share * all.residual;
  return slice.excess - share * all.excess + apart * apart / slice.count;
}

SliceBins::SliceBins(const ResidualCovariate* covariate, std::vector<double> values) : covariate_(covariate) {
  if (covariate->is_category()) {
    category_ = true;
    count_ = covariate->labels.size() <= kMax ? static_cast<int>(covariate->labels.size()) : 1;
    return;
  }
  values.erase(std::remove_if(values.begin(), values.end(), [](double v) { return !std::isfinite(v); }),
               values.end());
  if (values.empty()) return;
  std::sort(values.begin(), values.end());

  // Few distinct numbers are levels.
  for (size_t k = 0; k < values.size() && levels_.size() <= kSliceRules.few_levels; ++k)
    if (levels_.empty() || values[k] > levels_.back() + 1e-6 * (values.back() - values.front()))
      levels_.push_back(values[k]);
  if (levels_.size() <= kSliceRules.few_levels) {
    category_ = true;
    count_ = static_cast<int>(levels_.size());
    return;
  }
  levels_.clear();

  // Else multiples of a readable step over the middle of the range.
  const double low = values[values.size() / 40], high = values[values.size() - 1 - values.size() / 40];
  if (high <= low) return;
  const double step = ReadableStep((high - low) / kSliceRules.thresholds);
  for (double t = std::ceil(low / step) * step; t < high && thresholds_.size() < kMax - 1; t += step)
    thresholds_.push_back(std::round(t / step) * step);
  count_ = static_cast<int>(thresholds_.size()) + 1;
}

uint8_t SliceBins::Bin(double value) const {
  if (std::isnan(value) || count_ == 1) return kUnknown;
  if (!levels_.empty()) {
    const auto next = std::lower_bound(levels_.begin(), levels_.end(), value);
    if (next == levels_.begin()) return 0;
    if (next == levels_.end()) return static_cast<uint8_t>(levels_.size() - 1);
    return static_cast<uint8_t>(next - levels_.begin() - (value - next[-1] < *next - value));
  }
  if (category_) return value >= 0 && value < count_ ? static_cast<uint8_t>(value) : kUnknown;
  return static_cast<uint8_t>(std::upper_bound(thresholds_.begin(), thresholds_.end(), value) -
                              thresholds_.begin());
}

std::string SliceBins::Number(double value) const {
  // Long times are read in minutes.
  const bool minutes = covariate_->unit == "s" && !thresholds_.empty() && thresholds_.back() >= 600;
  const std::string unit = minutes ? "min" : covariate_->unit;
  // Six figures; tenths of a minute, which nobody reads more finely.
  const double rounded = minutes ? std::round(value / 6) / 10 : std::stod(absl::StrCat(value));
  return unit.empty() ? ShortestNumber(rounded) : absl::StrCat(ShortestNumber(rounded), " ", unit);
}

std::string SliceBins::Words(int low, int high) const {
  const std::string& words = covariate_->words;
  if (low == 0 && high == count_ - 1) return "";
  if (!levels_.empty()) return absl::StrCat(words, " = ", Number(levels_[low]));
  if (category_) {
    const std::string& label = covariate_->labels[low];
    return covariate_->name == "first" ? label : absl::StrCat(words, " = ", label);
  }
  if (low == 0) return absl::StrCat(words, " < ", Number(thresholds_[high]));
  if (high == count_ - 1) return absl::StrCat(words, " > ", Number(thresholds_[low - 1]));
  return absl::StrCat(Number(thresholds_[low - 1]), " < ", words, " < ", Number(thresholds_[high]));
}

namespace {

Sums SumOf(const SliceCells& cells, int cell) {
  return {1, cells.excess_s2[cell], cells.residual_s[cell]};
}

// Scores parts of the cells listed in `live`; those that leave too little inside or outside are out.
class LiveCells {
 public:
  LiveCells(const SliceCells& cells, const std::vector<int>& live, int min_cells)
      : cells_(cells), live_(live), min_cells_(min_cells) {
    for (const int cell : live) all_ += SumOf(cells, cell);
  }

  double Score(const Sums& part) const {
    // What is left outside must be a part of its own, too.
    if (part.count < min_cells_ || all_.count - part.count < min_cells_) return -HUGE_VAL;
    return SliceScore(part, all_);
  }
  SliceCandidate BestOfOne(const std::vector<SliceBins>& bins, int covariate) const;
  SliceCandidate BestOfTwo(const std::vector<SliceBins>& bins, int a, int b) const;
  bool empty() const { return all_.count == 0; }

 private:
  // Sums over the cells whose bin of covariate a is below the row and of b below the column; (bins of a + 1)
  // rows, (bins of b + 1) columns.
  std::vector<Sums> CumulativeTable(const std::vector<SliceBins>& bins, int a, int b) const;

  const SliceCells& cells_;
  const std::vector<int>& live_;
  const int min_cells_;
  Sums all_;
};

// One condition, or a range of one number.
SliceCandidate LiveCells::BestOfOne(const std::vector<SliceBins>& bins, int c) const {
  std::array<Sums, SliceBins::kMax + 1> below{};  // below[b]: of all bins before b
  for (const int cell : live_) {
    const uint8_t bin = cells_.bin[c][cell];
    if (bin != SliceBins::kUnknown) below[bin + 1] += SumOf(cells_, cell);
  }
  for (int b = 0; b < bins[c].count(); ++b) below[b + 1] += below[b];
  SliceCandidate best;
  const auto consider = [&](int low, int high, double worth) {
    const double value = worth * Score(below[high + 1] - below[low]);
    if (value > best.score) best = {{{c, static_cast<uint8_t>(low), static_cast<uint8_t>(high)}}, value};
  };
  for (const auto& [low, high] : Ranges(bins[c])) consider(low, high, 1);
  if (!bins[c].category())
    for (int low = 1; low < bins[c].count() - 1; ++low)
      for (int high = low; high < bins[c].count() - 1; ++high)
        consider(low, high, kSliceRules.second_condition);
  return best;
}

std::vector<Sums> LiveCells::CumulativeTable(const std::vector<SliceBins>& bins, int a, int b) const {
  const int width = bins[b].count() + 1;
  std::vector<Sums> below(static_cast<size_t>(bins[a].count() + 1) * width);
  for (const int cell : live_) {
    const uint8_t row = cells_.bin[a][cell], column = cells_.bin[b][cell];
    if (row == SliceBins::kUnknown || column == SliceBins::kUnknown) continue;
    below[(row + 1) * width + column + 1] += SumOf(cells_, cell);
  }
  for (int row = 1; row <= bins[a].count(); ++row) {
    Sums in_row;
    for (int column = 1; column < width; ++column) {
      in_row += below[row * width + column];
      below[row * width + column] = below[(row - 1) * width + column];
      below[row * width + column] += in_row;
    }
  }
  return below;
}

// Two conditions on two covariates.
SliceCandidate LiveCells::BestOfTwo(const std::vector<SliceBins>& bins, int a, int b) const {
  const int width = bins[b].count() + 1;
  const std::vector<Sums> below = CumulativeTable(bins, a, b);
  SliceCandidate best;
  const auto ranges_b = Ranges(bins[b]);
  for (const auto& [low_a, high_a] : Ranges(bins[a])) {
    const Sums* const after = &below[(high_a + 1) * width];
    const Sums* const before = &below[low_a * width];
    for (const auto& [low_b, high_b] : ranges_b) {
      const double value = kSliceRules.second_condition *
                           Score((after[high_b + 1] - after[low_b]) - (before[high_b + 1] - before[low_b]));
      if (value > best.score)
        best = {{{a, static_cast<uint8_t>(low_a), static_cast<uint8_t>(high_a)},
                 {b, static_cast<uint8_t>(low_b), static_cast<uint8_t>(high_b)}},
                value};
    }
  }
  return best;
}

}  // namespace

std::vector<SliceCandidate> SearchSlices(const std::vector<SliceBins>& bins, const SliceCells& cells,
                                         const std::vector<int>& live, int min_cells, int max_slices) {
  const LiveCells live_cells(cells, live, min_cells);
  if (live_cells.empty()) return {};
  std::vector<SliceCandidate> found;
  const auto keep = [&](SliceCandidate best) {
    if (!best.conditions.empty()) found.push_back(std::move(best));
  };
  const int covariates = static_cast<int>(bins.size());
  for (int c = 0; c < covariates; ++c) keep(live_cells.BestOfOne(bins, c));
  for (int a = 0; a < covariates; ++a)
    for (int b = a + 1; b < covariates; ++b) keep(live_cells.BestOfTwo(bins, a, b));
  std::stable_sort(found.begin(), found.end(),
                   [](const SliceCandidate& x, const SliceCandidate& y) { return x.score > y.score; });
  if (static_cast<int>(found.size()) > max_slices) found.resize(max_slices);
  return found;
}

SliceCandidate Simplified(const std::vector<SliceBins>& bins, const SliceCells& cells,
                          const std::vector<int>& live, const SliceCandidate& slice) {
  // Every condition alone, and a range with either end open.
  std::vector<SliceCandidate> simpler;
  if (slice.conditions.size() > 1) {
    for (const SliceCondition& condition : slice.conditions) simpler.push_back({{condition}, 0});
  } else {
    const SliceCondition& range = slice.conditions[0];
    const int last = bins[range.covariate].count() - 1;
    if (bins[range.covariate].category() || range.low == 0 || range.high == last) return slice;
    simpler.push_back({{{range.covariate, 0, range.high}}, 0});
    simpler.push_back({{{range.covariate, range.low, static_cast<uint8_t>(last)}}, 0});
  }
  const auto score = [&](const SliceCandidate& candidate) {
    Sums all, inside;
    for (const int cell : live) {
      const Sums one = SumOf(cells, cell);
      all += one;
      bool holds = true;
      for (const SliceCondition& condition : candidate.conditions)
        holds &= condition.Holds(cells.bin[condition.covariate][cell]);
      if (holds) inside += one;
    }
    return inside.count == 0 ? 0 : SliceScore(inside, all);
  };
  const double whole = score(slice);
  const SliceCandidate* best = &slice;
  double best_score = kSliceRules.one_condition_keeps * whole;
  for (SliceCandidate& candidate : simpler) {
    candidate.score = score(candidate);
    if (candidate.score >= best_score) best = &candidate, best_score = candidate.score;
  }
  return *best;
}

}  // namespace touchstone::diagnosis::residuals
