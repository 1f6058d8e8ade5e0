// For tests of the engine: rows that follow the values of effects in a way that the test chooses. No touch takes part.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "server/base/numbers/random.h"
#include "server/diagnosis/engine/fit/observation_model.h"

namespace touchstone::diagnosis::engine {

// predicted[r] = sum over the model's effects of column[r] * (v + bend * v^2), v what the effect's first value, SI, has beyond
// `dead`.
class LinearTestModel : public ObservationModel {
 public:
  // `groups` x `blocks` x `repeats` rows, block by block; groups are "a", "b", ...
  LinearTestModel(int groups, int blocks, int repeats)
      : rows_per_group_(blocks * repeats), repeats_(repeats) {
    for (int g = 0; g < groups; ++g) names_.push_back(std::string(1, static_cast<char>('a' + g)));
    measured.setZero(groups * rows_per_group_);
  }

  int rows() const override { return static_cast<int>(measured.size()); }
  const std::vector<std::string>& groups() const override { return names_; }
  int FirstRowOfGroup(int group) const override { return group * rows_per_group_; }
  int GroupOfRow(int row) const override { return row / rows_per_group_; }
  int BlockOfRow(int row) const override { return row / repeats_; }
  double TimeOfRow(int row) const override { return row; }

  absl::StatusOr<std::vector<double>> Predict(const model::Model& model) const override {
    std::vector<double> predicted(rows(), 0.0);
    for (const model::EffectInstance& instance : model.effects) {
      const auto column = columns.find(instance.effect->name);
      if (column == columns.end()) continue;
      for (int r = 0; r < rows(); ++r) {
        const double value = instance.ValuesFor(names_[GroupOfRow(r)])[0];
        const double v = std::copysign(std::max(std::abs(value) - dead, 0.0), value);
        predicted[r] += column->second[r] * (v + bend * v * v);
      }
    }
    return predicted;
  }
  Eigen::VectorXd Residual(const std::vector<double>& predicted) const override {
    return measured - Eigen::Map<const Eigen::VectorXd>(predicted.data(), rows());
  }
  Eigen::VectorXd Change(const std::vector<double>& predicted,
                         const std::vector<double>& moved) const override {
    return Eigen::Map<const Eigen::VectorXd>(moved.data(), rows()) -
           Eigen::Map<const Eigen::VectorXd>(predicted.data(), rows());
  }

  Eigen::VectorXd Random(uint64_t seed, double sigma) const {
    RandomStream random(seed, RandomDomain::kTest);
    Eigen::VectorXd values(rows());
    for (int r = 0; r < rows(); ++r) values[r] = sigma * random.Normal();
    return values;
  }

  Eigen::VectorXd measured;
  std::map<std::string, Eigen::VectorXd> columns;  // by effect: change per SI unit of its first value
  double bend = 0;                                 // per SI unit
  double dead = 0;                                 // SI: smaller values change nothing

 private:
  int rows_per_group_, repeats_;
  std::vector<std::string> names_;
};

}  // namespace touchstone::diagnosis::engine
