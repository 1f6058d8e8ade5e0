// How wrong is a model, where, why, and what to do (DESIGN 8 and 9).
//
// The three calls are pure functions of their input: the same input gives the same report, whatever the
// number of threads. They never fail because the data are poor: they say what the data can tell. They fail on
// input that contradicts itself (an object without a mesh, other numbers of fingers).
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/base/thread_pool.h"
#include "server/geometry/surface.h"
#include "server/model/model.h"
#include "server/session/measurement_set.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone {

struct DiagnosisInput {
  std::shared_ptr<const Model> model;
  std::shared_ptr<const MeasurementSet> set;
  std::map<std::string, std::shared_ptr<const Surface>> surfaces;  // by the set's object names
  std::vector<std::shared_ptr<const Effect>> also;  // formulas of the user that compete with the catalogue
  uint64_t seed = 0;
};

struct DiagnosisContext {
  ThreadPool* pool = nullptr;  // null: this thread alone
  // Called often, from one thread at a time. Returns false to cancel: the call then ends with CANCELLED soon.
  std::function<bool(const std::string& stage, double done)> progress;
};

// How wrong and where. `verdict` stays unspecified.
absl::StatusOr<v1::Report> Compare(const DiagnosisInput& input, const DiagnosisContext& context);

// Also why, what to add, and what the error becomes.
absl::StatusOr<v1::Report> Diagnose(const DiagnosisInput& input, const DiagnosisContext& context);

// Diagnose, with `touches` further touches that would tell the explanations that are left apart.
absl::StatusOr<v1::Report> Propose(const DiagnosisInput& input, int touches, const DiagnosisContext& context);

}  // namespace touchstone
