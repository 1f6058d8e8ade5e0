#include "client/source/plans/session_parts.h"

#include <algorithm>

namespace touchstone::client {
namespace {

constexpr size_t kPrevious = 2;  // that act on what follows

}  // namespace

v1::TouchRequest PartOfSession(const std::vector<MeasuredTouch>& session, size_t first, size_t max_touches) {
  v1::TouchRequest request;
  request.set_object(session[first].object);
  request.set_first_index(first);
  for (size_t k = first; k < session.size() && k - first < max_touches; ++k) {
    if (session[k].object != session[first].object) break;
    *request.add_touches() = session[k].commanded;
  }
  for (size_t k = first - std::min(first, kPrevious); k < first; ++k) {
    v1::PreviousTouch* previous = request.add_previous();
    previous->set_object(session[k].object);
    *previous->mutable_touch() = session[k].commanded;
  }
  return request;
}

}  // namespace touchstone::client
