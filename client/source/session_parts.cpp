#include "client/source/session_parts.h"

namespace touchstone::client {

v1::TouchRequest PartOfSession(const std::vector<MeasuredTouch>& session, size_t first, size_t max_touches) {
  v1::TouchRequest request;
  request.set_object(session[first].object);
  request.set_first_index(first);
  for (size_t k = first; k < session.size() && k - first < max_touches; ++k) {
    if (session[k].object != session[first].object) break;
    *request.add_touches() = session[k].commanded;
  }
  if (first > 0) {
    request.mutable_previous()->set_object(session[first - 1].object);
    *request.mutable_previous()->mutable_touch() = session[first - 1].commanded;
  }
  return request;
}

}  // namespace touchstone::client
