#include "client/source/plans/journalled_touches.h"

#include <algorithm>
#include <map>

#include <absl/strings/str_cat.h>

#include "server/base/status.h"

namespace touchstone::client {
namespace {

// Object and command as a measurement file has them, without what differs between repeats of it.
std::string KeyOf(const MeasuredTouch& touch) {
  MeasuredTouch bare;
  bare.object = touch.object;
  bare.commanded = touch.commanded;
  bare.commanded.clear_session_time_s();
  bare.commanded.clear_covariates();
  return FormatMeasurements({bare});
}

// The measurement file of a session; "" where the source has no such session.
absl::StatusOr<std::string> CsvOfSession(Connection* connection, const std::string& session) {
  std::string csv;
  const absl::Status status = connection->Retrying([&] {
    csv.clear();
    v1::ExportSessionRequest request;
    request.set_name(session);
    grpc::ClientContext context;
    const auto reader = connection->sessions().ExportSession(&context, request);
    v1::ExportSessionResponse piece;
    while (reader->Read(&piece))
      if (piece.file().empty() || piece.file() == "touches.csv") csv += piece.csv();
    return FromGrpc(reader->Finish());
  });
  if (absl::IsNotFound(status)) return std::string();
  if (!status.ok()) return status;
  return csv;
}

}  // namespace

absl::StatusOr<std::vector<bool>> TouchesInJournal(Connection* connection, const std::string& session,
                                                   const std::vector<MeasuredTouch>& plan) {
  std::vector<bool> has(plan.size());
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string csv, CsvOfSession(connection, session));
  if (std::count(csv.begin(), csv.end(), '\n') < 2) return has;  // its header alone
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<MeasuredTouch> done,
                              ParseMeasurements(csv, absl::StrCat("session '", session, "'")));
  std::map<std::string, size_t> left;
  for (const MeasuredTouch& touch : done) ++left[KeyOf(touch)];
  for (size_t k = 0; k < plan.size(); ++k) {
    const auto found = left.find(KeyOf(plan[k]));
    if (found == left.end() || found->second == 0) continue;
    --found->second;
    has[k] = true;
  }
  return has;
}

}  // namespace touchstone::client
