#include "client/cli/session/images.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <filesystem>
#include <fstream>

#include "client/cli/common/interrupt.h"
#include "client/cli/common/output_file.h"
#include "client/source/connection/errors.h"
#include "client/source/plans/image_set_files.h"
#include "server/base/files/file_writer.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/service/sessions/stored_session.h"
#include "server/session/images/image_set_file.h"
#include "server/session/images/image_set_hdf5.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

using TakePiece = std::function<bool(const std::string& file, absl::string_view piece)>;

// A measurement file goes out as it is read: it may be larger than the memory.
absl::Status ReadFileInPieces(const std::string& path, const TakePiece& take) {
  std::ifstream file(path, std::ios::binary);
  std::error_code error;
  if (!file || !fs::is_regular_file(path, error))
    return absl::NotFoundError(absl::StrCat(
        path, ": cannot be read; a measurement file or the folder of an image set was expected"));
  std::string piece(service::kSessionPieceBytes, '\0');
  do {
    file.read(piece.data(), service::kSessionPieceBytes);
    if (!take("", absl::string_view(piece).substr(0, file.gcount()))) break;
  } while (file);
  return absl::OkStatus();
}

absl::StatusOr<service::StoredSession> ReadSessionHdf5(const std::string& path) {
  if (std::error_code error; !fs::is_regular_file(path, error))
    return absl::NotFoundError(
        absl::StrCat(path, ": cannot be read; the HDF5 file of an image set was expected"));
  if (!session::IsImageSetHdf5(path))
    return absl::InvalidArgumentError(absl::StrCat(
        path, ": is not the HDF5 file of an image set; a session of a rig's journal goes into a journal: ",
        "touchstone session import ", path, " -o session.db"));
  TOUCHSTONE_ASSIGN_OR_RETURN(session::ImageSetWithTouches set, session::ReadImageSetHdf5(path));
  return service::StoredSession{std::move(set.touches_csv), std::move(set.images)};
}

absl::StatusOr<service::StoredSession> ReadSessionFolder(const std::string& folder) {
  service::StoredSession session;
  TOUCHSTONE_ASSIGN_OR_RETURN(session.images, client::ReadImageSetFiles(folder));
  if (client::HasTouches(folder)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(session.csv, ReadFile((fs::path(folder) / client::kTouchesCsv).string()));
  }
  return session;
}

absl::Status WriteSessionFolder(const service::StoredSession& session, const std::string& folder) {
  if (client::HasTouches(folder))
    return absl::AlreadyExistsError(absl::StrCat((fs::path(folder) / client::kTouchesCsv).string(),
                                                 " exists already; a new folder was expected"));
  std::map<std::string, std::string> others;
  if (!session.csv.empty()) others[client::kTouchesCsv] = session.csv;
  return client::WriteImageSetFiles(*session.images, folder, others);
}

}  // namespace

bool IsHdf5Path(const std::string& path) {
  return absl::EndsWith(path, ".h5") || absl::EndsWith(path, ".hdf5");
}

absl::StatusOr<service::StoredSession> ReadImageSession(const std::string& path) {
  return IsHdf5Path(path) ? ReadSessionHdf5(path) : ReadSessionFolder(path);
}

absl::StatusOr<v1::Session> SendSession(client::Connection* connection, const std::string& path,
                                        const std::string& name, bool check) {
  std::error_code error;
  std::string folder_bytes;
  const bool folder = fs::is_directory(path, error) || IsHdf5Path(path);
  // What is wrong with a folder is said before anything is sent.
  if (folder) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const service::StoredSession session, ReadImageSession(path));
    folder_bytes = service::PackSession(session);
  } else {
    // ... and of a file that is not there.
    TOUCHSTONE_RETURN_IF_ERROR(
        ReadFileInPieces(path, [](const std::string&, absl::string_view) { return false; }));
  }
  grpc::ClientContext context;
  const Interrupt::Handler handler([&context] { context.TryCancel(); });
  v1::Session session;
  const auto writer = connection->sessions().CreateSession(&context, &session);
  v1::CreateSessionRequest request;
  request.set_name(name);
  request.set_validate_only(check);
  const TakePiece send = [&](const std::string& file, absl::string_view piece) {
    request.set_file(file);
    request.set_csv(std::string(piece));
    const bool sent = writer->Write(request);
    request.clear_name();
    return sent;
  };
  const absl::Status read = folder ? service::ForEachPiece(folder_bytes, service::kSessionPieceBytes, send)
                                   : ReadFileInPieces(path, send);
  if (!read.ok()) context.TryCancel();
  writer->WritesDone();
  const absl::Status finished = client::FromGrpc(writer->Finish());
  TOUCHSTONE_RETURN_IF_ERROR(read);
  TOUCHSTONE_RETURN_IF_ERROR(WithFile(finished, name, path));
  return session;
}

absl::Status WithFile(const absl::Status& status, const std::string& session, const std::string& path) {
  if (!absl::StartsWith(status.message(), session + ":")) return status;
  return absl::Status(status.code(), absl::StrCat(path, status.message().substr(session.size())));
}

namespace {

absl::StatusOr<service::StoredSession> FetchOnce(client::Connection* connection,
                                                 const v1::ExportSessionRequest& request,
                                                 std::string* left_out) {
  grpc::ClientContext context;
  const Interrupt::Handler handler([&context] { context.TryCancel(); });
  const auto reader = connection->sessions().ExportSession(&context, request);
  v1::ExportSessionResponse response;
  service::SessionPieces pieces;
  absl::Status wrong;
  while (wrong.ok() && reader->Read(&response)) wrong = pieces.Append(response.file(), response.csv());
  if (!wrong.ok()) context.TryCancel();
  absl::Status finished = client::FromGrpc(reader->Finish());
  if (!Interrupt::Raised()) finished = client::LostWhereCancelled(finished);
  TOUCHSTONE_RETURN_IF_ERROR(wrong);
  TOUCHSTONE_RETURN_IF_ERROR(finished);
  const auto& trailing = context.GetServerTrailingMetadata();
  if (const auto words = trailing.find(service::kLeftOutMetadata); words != trailing.end())
    left_out->assign(words->second.data(), words->second.size());
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string bytes, pieces.Take());
  return service::UnpackSession(bytes);
}

}  // namespace

absl::StatusOr<service::StoredSession> FetchSession(client::Connection* connection, const std::string& name,
                                                    std::string* left_out) {
  v1::ExportSessionRequest request;
  request.set_name(name);
  absl::StatusOr<service::StoredSession> session;
  TOUCHSTONE_RETURN_IF_ERROR(connection->Retrying([&] {
    session = FetchOnce(connection, request, left_out);
    return session.status();
  }));
  return session;
}

absl::Status WriteExportedSession(const Cli& cli, const std::string& name,
                                  const service::StoredSession& session, const std::string& output) {
  const bool a_file = output.empty() || IsStandardOutput(output) || absl::EndsWith(output, ".csv");
  if (!session.images && IsHdf5Path(output))
    return absl::InvalidArgumentError(
        absl::StrCat("-o: session '", name,
                     "' has touches alone, which a server gives as a measurement file; "
                     "name one (.csv). A journal's session is also written as .h5"));
  if (!session.images) return cli.Write(output, session.csv);
  const std::string photographs = Counted(session.images->files_size(), "photograph", "photographs");
  if (!a_file) {
    TOUCHSTONE_RETURN_IF_ERROR(
        IsHdf5Path(output)
            ? WriteOutputFileBy(
                  output, cli.output().force,
                  [&](const std::string& free_path) {
                    return session::WriteImageSetHdf5({*session.images, session.csv}, free_path);
                  })
            : WriteSessionFolder(session, output));
    cli.Log(absl::StrCat(output, ": ", photographs, session.csv.empty() ? "" : ", and touches.csv"));
    return absl::OkStatus();
  }
  if (session.csv.empty())
    return absl::InvalidArgumentError(
        absl::StrCat("-o: session '", name, "' holds photographs, and a folder for them was expected"));
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(output, session.csv));
  cli.Log(absl::StrCat(photographs, " of session '", name,
                       "' are not in a measurement file: -o FOLDER writes them too"));
  return absl::OkStatus();
}

}  // namespace touchstone::cli
