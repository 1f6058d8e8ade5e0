// The most that one request, one client or the whole process may use: the one table that the configuration, the checks,
// Source.Describe and server/LIMITS.md share.
#pragma once

#include <cstddef>
#include <string>
#include <variant>

#include <absl/status/status.h>
#include <absl/strings/string_view.h>
#include <absl/types/span.h>

#include "server/session/measurements/measurement_set.h"
#include "server/source/source_limits.h"

namespace touchstone::service {

inline constexpr size_t kMebibyte = 1 << 20;

// What each bounds stands in the table (limits.cpp). Both servers have them all; a gateway uses those that concern it.
struct Limits {
  int max_request_mib = 4;
  int max_upload_mib = 64;
  int max_message_mib = 256;
  int max_request_elements = 200'000;
  int max_request_numbers = 10'000'000;
  int max_touches_per_request = 20'000;
  int max_images_per_request = 1000;
  int max_indices_per_request = 100'000;
  int max_batch_size = 65536;
  int max_proposed_touches = 1000;
  int max_objects = 256;
  double min_step_angle_rad = 1e-3;
  int max_draws = 10'000;
  int max_model_kib = 256;
  int max_model_nodes = 20'000;
  int max_model_objects = 1000;
  int max_session_mib = 256;
  int max_sessions_mib = 4096;
  int max_page_size = 1000;
  int max_session_touches = 4'000'000;
  int max_session_objects = 1000;
  int max_session_columns = 64;
  double max_time_us = 1e10;
  int max_streams = 256;
  int max_streams_per_client = 128;
  int max_uploads = 16;
  int max_diagnoses = 4;
  int max_diagnoses_per_client = 1;
  double max_diagnosis_s = 1800;
  double stall_s = 300;
  int stream_memory_mib = 32;
  int max_memory_mib = 0;
  int max_connections = 0;
  int max_connections_per_address = 128;
  int max_streams_per_connection = 128;
  int max_threads = 512;
  double handshake_s = 10;
  double connection_idle_s = 900;
  double connection_age_s = 43200;
  double keepalive_s = 60;
  double keepalive_timeout_s = 20;
  int max_unary_calls_per_s = 200;
  double max_unary_s = 60;
  int max_calls_per_address = 256;
  int max_resets_per_s = 1000;
  int max_pings_per_s = 100;
  int max_frames_per_s = 200'000;
  int max_header_kib = 64;
  double flood_s = 10;
  double self_probe_s = 60;
  double drain_s = 8;

  source::SourceLimits OfSource() const {
    return {max_touches_per_request, max_images_per_request, max_batch_size, max_indices_per_request};
  }
  session::MeasurementLimits OfMeasurements() const {
    return {static_cast<size_t>(max_session_touches), static_cast<size_t>(max_session_columns),
            static_cast<size_t>(max_session_objects), max_time_us};
  }
};

struct LimitRow {
  const char* name;     // of the key, and as a flag with dashes
  const char* unit;     // "MiB"; empty: a count
  const char* meaning;  // what it bounds, for people
  std::variant<int Limits::*, double Limits::*> field;
  double lower, upper;  // what may be configured

  double Value(const Limits& limits) const;
  // "4 MiB", "20000".
  std::string ValueInWords(const Limits& limits) const;
};

absl::Span<const LimitRow> LimitTable();

// Errors name the key and its range.
absl::Status CheckLimits(const Limits& limits);

}  // namespace touchstone::service
