// gRPC-Web as browsers speak it over HTTP/1.1 (https://github.com/grpc/grpc/blob/master/doc/PROTOCOL-WEB.md): messages in
// gRPC's own frames, and the status in a last frame, since a browser shows no trailers of HTTP.
#pragma once

#include <chrono>
#include <map>
#include <optional>
#include <string>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>
#include <grpcpp/support/status.h>
#include <grpcpp/support/string_ref.h>

namespace touchstone::workbench {

inline constexpr char kGrpcWebType[] = "application/grpc-web+proto";

// Whether a content type is gRPC-Web with messages of protobuf, not the base64 variant.
bool IsGrpcWebType(absl::string_view content_type);

// The one message of a unary or server-streaming call's body. INVALID_ARGUMENT where the body is cut off, has more than one
// frame, or a frame that is no message; UNIMPLEMENTED where it is compressed.
absl::StatusOr<absl::string_view> OneMessage(absl::string_view body);

std::string MessageFrame(absl::string_view message);

using Metadata = std::multimap<grpc::string_ref, grpc::string_ref>;

// Status and trailing metadata: the last frame of an answer.
std::string TrailersFrame(const grpc::Status& status, const Metadata& metadata);

// A header's value: base64 without padding for names that end in -bin.
std::string HeaderValue(const std::string& name, absl::string_view value);

// As grpc-message has it: what is no visible ASCII, and %, as %XX.
std::string PercentEncoded(absl::string_view text);

// "100m": 100 milliseconds. Nothing where it is no time-out of gRPC's.
std::optional<std::chrono::nanoseconds> ParseTimeout(absl::string_view text);

// Whether the bridge forwards "/package.Service/Method". What is inside of this process asks for no credentials, so the bridge
// asks by itself: what a reader may do at a rig (server/service/options/access_roles.cpp) is forwarded, and nothing else.
// PERMISSION_DENIED says which role it takes; UNIMPLEMENTED: no service has it.
absl::Status CheckMethod(absl::string_view path);

}  // namespace touchstone::workbench
