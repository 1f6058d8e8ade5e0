// What the tables of script functions share.
#pragma once

#include <utility>
#include <vector>

#include "tests/rig/controller/machine/machine.h"

namespace touchstone::rig {
namespace builtin {

using Arguments = std::vector<Value>;
using Function = Outcome (*)(Machine& machine, const Arguments& arguments, int thread);

inline bool Given(const Arguments& arguments, size_t i) {
  return i < arguments.size() && arguments[i].kind != Value::Kind::kNone;
}
inline double NumberOr(const Arguments& arguments, size_t i, const char* what, double otherwise) {
  return Given(arguments, i) ? arguments[i].AsNumber(what) : otherwise;
}
inline Outcome Result(Value value) {
  return {Outcome::Wait::kNone, std::move(value), 0};
}
inline Outcome Number(double number) {
  return Result(Value::Number(number));
}
inline Outcome Nothing(Machine&, const Arguments&, int) {
  return {};
}
inline Outcome Pose(const Eigen::Isometry3d& transform) {
  return Result(Value::Vector(ToPose(transform), Value::Kind::kPose));
}

}  // namespace builtin

struct BuiltinRow {
  BuiltinSignature signature;
  builtin::Function function;
};

// Functions that clients' programs name, beside those that this project's programs need.
std::vector<BuiltinRow> OtherBuiltins();

}  // namespace touchstone::rig
