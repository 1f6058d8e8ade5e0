#include "server/service/sessions/journalled_session.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/session/session_images.h"
#include "server/session/session_measurements.h"

namespace touchstone::service {

absl::StatusOr<JournalledSession> FilesOfJournal(const session::Journal& journal,
                                                 const session::JournalSession& session) {
  JournalledSession made;
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<session::MeasuredTouch> touches,
                              session::SessionMeasurements(journal, session.name));
  if (session.images > 0) {
    absl::StatusOr<v1::ImageSetFiles> images = session::SessionImageSetFiles(journal, session.name);
    if (images.ok())
      made.files.images = *std::move(images);
    else if (touches.empty() || !absl::IsFailedPrecondition(images.status()))
      return images.status();
    else
      made.left_out =
          absl::StrCat(session.images, session.images == 1 ? " photograph is" : " photographs are",
                       " left out: ", images.status().message());
  }
  // Without a touch the header of a measurement file stands alone; beside photographs there is no such file.
  if (!touches.empty() || !made.files.images) made.files.csv = session::FormatMeasurements(touches);
  return made;
}

}  // namespace touchstone::service
