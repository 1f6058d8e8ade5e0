#include "server/service/options/limits.h"

#include <absl/strings/str_cat.h>

#include <limits>

#include "server/base/status.h"
#include "server/base/text/over_limit.h"
#include "server/service/options/option_table.h"

namespace touchstone::service {
namespace {

constexpr double kMaxInt = std::numeric_limits<int>::max();

const LimitRow kTable[] = {
    {"max_request_mib", "MiB", "size of a request", &Limits::max_request_mib, 1, 2047},
    {"max_upload_mib", "MiB", "size of a message of an upload or a diagnosis", &Limits::max_upload_mib, 1,
     2047},
    {"max_message_mib", "MiB", "size of an answer", &Limits::max_message_mib, 1, 2047},
    {"max_request_elements", "", "messages and texts in a request, counted before it is decoded",
     &Limits::max_request_elements, 100, kMaxInt},
    {"max_request_numbers", "", "numbers in the lists of a request, counted before it is decoded",
     &Limits::max_request_numbers, 100, kMaxInt},
    {"max_touches_per_request", "", "explicit touches of a request, a list plan or an answer",
     &Limits::max_touches_per_request, 1, 10'000'000},
    {"max_images_per_request", "", "photographs of a request", &Limits::max_images_per_request, 1, 1'000'000},
    {"max_indices_per_request", "", "samples that a request asks for one by one",
     &Limits::max_indices_per_request, 1, 10'000'000},
    {"max_batch_size", "", "samples of a batch", &Limits::max_batch_size, 1, 1 << 20},
    {"max_proposed_touches", "", "touches or photographs that a request has proposed",
     &Limits::max_proposed_touches, 1, 100'000},
    {"max_objects", "", "distinct objects of a dataset", &Limits::max_objects, 1, 10'000},
    {"min_step_angle_rad", "rad", "smallest step of a plan's angles", &Limits::min_step_angle_rad, 1e-5, 1},
    {"max_draws", "", "draws of one touch that a request may allow", &Limits::max_draws, 1, 1'000'000},
    {"max_model_kib", "KiB", "size of a model file", &Limits::max_model_kib, 1, 1024},
    {"max_model_nodes", "", "keys and values of a model file", &Limits::max_model_nodes, 100, 100'000},
    {"max_model_objects", "", "objects that an effect of a model has values of", &Limits::max_model_objects,
     1, 100'000},
    {"max_session_mib", "MiB", "size of a stored session", &Limits::max_session_mib, 1, 4095},
    {"max_sessions_mib", "MiB", "size of all stored sessions, and of all that are being sent",
     &Limits::max_sessions_mib, 1, 1 << 30},
    {"max_page_size", "", "models or sessions of one page of a list", &Limits::max_page_size, 1, 100'000},
    {"max_session_touches", "", "touches of a measured set", &Limits::max_session_touches, 1, kMaxInt},
    {"max_session_objects", "", "objects of a measured set", &Limits::max_session_objects, 1, kMaxInt},
    {"max_session_columns", "", "columns of a measured set", &Limits::max_session_columns, 3, 4096},
    {"max_time_us", "us", "a measured contact time", &Limits::max_time_us, 1, 1e12},
    {"max_streams", "", "dataset streams at once", &Limits::max_streams, 1, 100'000},
    {"max_streams_per_client", "", "dataset streams at once of one client, by its address",
     &Limits::max_streams_per_client, 1, 100'000},
    {"max_uploads", "", "sessions that are being sent at once", &Limits::max_uploads, 1, 10'000},
    {"max_diagnoses", "", "sets compared, diagnosed or proposed for at once", &Limits::max_diagnoses, 1,
     1000},
    {"max_diagnoses_per_client", "", "the same of one client, by its address",
     &Limits::max_diagnoses_per_client, 1, 1000},
    {"max_diagnosis_s", "s", "time of a diagnosis, after which it is ended", &Limits::max_diagnosis_s, 0.01,
     1e6},
    {"stall_s", "s", "time for which a client may neither take nor send anything in a stream",
     &Limits::stall_s, 0.01, 1e6},
    {"stream_memory_mib", "MiB", "memory of a dataset stream; less while many run",
     &Limits::stream_memory_mib, 1, 4096},
    {"max_memory_mib", "MiB",
     "memory of the process beyond what it has after its start; 0: half of what its cgroups or the machine "
     "allow",
     &Limits::max_memory_mib, 0, 1 << 30},
    {"max_connections", "",
     "files and connections open at once; 0: 0.8 of what the system allows (ulimit -n)",
     &Limits::max_connections, 0, kMaxInt},
    {"max_connections_per_address", "", "connections of one address", &Limits::max_connections_per_address, 1,
     kMaxInt},
    {"max_streams_per_connection", "", "calls at once on a connection", &Limits::max_streams_per_connection,
     1, kMaxInt},
    {"max_threads", "", "threads that answer calls", &Limits::max_threads, 8, 100'000},
    {"handshake_s", "s", "time in which a new connection must speak", &Limits::handshake_s, 0.01, 1e6},
    {"connection_idle_s", "s", "time for which a connection may be without a call",
     &Limits::connection_idle_s, 0.01, 1e6},
    {"connection_age_s", "s", "age at which a connection takes no more calls", &Limits::connection_age_s, 1,
     1e6},
    {"keepalive_s", "s", "silence after which a client is asked for a sign of life", &Limits::keepalive_s,
     0.01, 1e6},
    {"keepalive_timeout_s", "s", "time that it has to give one", &Limits::keepalive_timeout_s, 0.01, 1e6},
    {"max_unary_calls_per_s", "",
     "unary calls a second of one client, by its address, over five seconds; 0: any number",
     &Limits::max_unary_calls_per_s, 0, kMaxInt},
    {"max_unary_s", "s",
     "time of an expansion, or of simulated touches or photographs, after which it is ended",
     &Limits::max_unary_s, 0.01, 1e6},
    {"max_calls_per_address", "",
     "calls at once of one address; beyond, each of its connections has one at a time",
     &Limits::max_calls_per_address, 1, kMaxInt},
    {"max_resets_per_s", "", "calls a second that a connection may begin and reset",
     &Limits::max_resets_per_s, 1, kMaxInt},
    {"max_pings_per_s", "",
     "pings, settings, priorities and empty data a second of a connection, over five seconds",
     &Limits::max_pings_per_s, 10, kMaxInt},
    {"max_frames_per_s", "",
     "other HTTP/2 frames a second of a connection, over five seconds, beside those of much data",
     &Limits::max_frames_per_s, 100, kMaxInt},
    {"max_header_kib", "KiB", "size of the headers of a call", &Limits::max_header_kib, 16, 1 << 20},
    {"flood_s", "s", "time for which a connection may ask for more than that, after which it is closed",
     &Limits::flood_s, 0.01, 1e6},
    {"self_probe_s", "s",
     "time after which the process asks itself through its port, and that an answer has; three unanswered "
     "questions end it (status 70); 0: never",
     &Limits::self_probe_s, 0, 1e6},
    {"drain_s", "s", "time that running calls get after SIGTERM", &Limits::drain_s, 0.01, 3600},
};

}  // namespace

double LimitRow::Value(const Limits& limits) const {
  return std::visit([&](auto member) { return static_cast<double>(limits.*member); }, field);
}

std::string LimitRow::ValueInWords(const Limits& limits) const {
  return absl::StrCat(LimitInWords(Value(limits)), *unit == '\0' ? "" : " ", unit);
}

absl::Span<const LimitRow> LimitTable() {
  return kTable;
}

absl::Status CheckLimits(const Limits& limits) {
  for (const LimitRow& row : kTable)
    TOUCHSTONE_RETURN_IF_ERROR(CheckRange(row.Value(limits), row.lower, row.upper, row.name));
  return absl::OkStatus();
}

}  // namespace touchstone::service
