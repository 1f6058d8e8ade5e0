// A kind of measurement that is nothing but rows: what a kind of your own begins with.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/base/threads/thread_pool.h"
#include "server/diagnosis/engine/modality.h"

namespace touchstone::diagnosis::engine {

// The errors of its models are those of the rows. Its noise is known, independent from row to row and the same for all; its
// groups have no smooth error.
class RowModality : public Modality {
 public:
  struct Description {
    std::string name;    // "contact forces"
    model::Model given;  // with the effects that this kind sees
    std::shared_ptr<const ObservationModel> rows;
    double noise = 0;                   // standard deviation of a row
    std::vector<Candidate> candidates;  // that `given` lacks
    std::function<bool(const model::Effect&)> sees;
    ThreadPool* pool = nullptr;  // null: this thread alone
    uint64_t seed = 0;           // of what is drawn
  };

  // Searches for what these rows alone are explained by. Errors as FitModel.
  static absl::StatusOr<std::unique_ptr<RowModality>> Make(Description description);

  std::string name() const override { return description_.name; }
  const model::Model& given() const override { return description_.given; }
  const std::vector<std::string>& objects() const override { return description_.rows->groups(); }
  bool Sees(const model::Effect& effect) const override { return description_.sees(effect); }
  const Experiment& experiment() const override { return experiment_; }
  const std::vector<Candidate>& candidates() const override { return description_.candidates; }
  const Fit& alone() const override { return alone_; }
  const TriedPValues& tried() const override { return tried_; }
  // The lack of fit is judged by the known noise (chi-square).
  absl::StatusOr<Quality> Compare(const model::Model& model) const override;

 private:
  explicit RowModality(Description description);

  Description description_;
  std::unique_ptr<Likelihood> likelihood_;
  Experiment experiment_;
  Fit alone_;
  TriedPValues tried_;
};

}  // namespace touchstone::diagnosis::engine
