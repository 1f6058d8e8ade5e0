// Which touches to make next: those that tell explanations apart that fit the present data alike.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/touches/observations.h"
#include "server/model/model.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone {

// At most `touches` touches, in the order of their worth. `rivals` are fitted models, best first, `names`
// what people call them.
//
// T-optimal (Atkinson and Fedorov 1975), one touch after the other: a touch is worth what the best
// explanation and a rival predict differently *after* the rival has been fitted again to all data, the new
// touches included; both ways round. A touch that all rivals can follow is worth nothing. Candidates come
// from all faces of all objects, with tilts up to 40 deg, any turn, and half, once and twice the set's speed;
// touches that end within 1 mm of a sharp edge are left out, since there a small error of the pose decides.
//
// With one rival: where its values would be learnt best (D-optimal). Empty if no touch would tell: then only
// another kind of measurement does. What a touch leaves to the next one (return_hysteresis) is not planned.
absl::StatusOr<std::vector<v1::ProposedTouch>> ProposeTouches(
    const Observations& observations, const std::vector<std::shared_ptr<const Model>>& rivals,
    const std::vector<std::string>& names, double sigma_s, int touches, uint64_t seed, ThreadPool* pool);

}  // namespace touchstone
