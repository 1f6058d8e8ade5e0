# Manual pages and shell completion, out of what the programs say of themselves:
#   cmake -D BIN=build/bin -D INTO=build/documents -P documents.cmake
# makes INTO/share/... as a system has them. Programs that were built for another system cannot be asked.
set(man ${INTO}/share/man/man1)
file(REMOVE_RECURSE ${INTO})
file(MAKE_DIRECTORY ${man})

# page(NAME program argument ...)
function(page name)
  execute_process(COMMAND ${ARGN} OUTPUT_VARIABLE text COMMAND_ERROR_IS_FATAL ANY)
  file(WRITE ${man}/${name}.1 "${text}")
  # Without the time, so that the same page has the same bytes.
  execute_process(COMMAND gzip -9 --no-name ${man}/${name}.1 COMMAND_ERROR_IS_FATAL ANY)
endfunction()

foreach(program touchstone-server touchstone-gateway touchstone-probe touchstone-rig-emulator)
  page(${program} ${BIN}/${program} --man)
endforeach()
execute_process(COMMAND ${BIN}/touchstone man --list OUTPUT_VARIABLE commands COMMAND_ERROR_IS_FATAL ANY)
string(STRIP "${commands}" commands)
string(REPLACE "\n" ";" commands "${commands}")
foreach(command ${commands})
  string(REPLACE " " "-" name "${command}")
  string(REPLACE " " ";" words "${command}")
  list(POP_FRONT words)
  page(${name} ${BIN}/touchstone man ${words})
endforeach()

set(bash bash-completion/completions/touchstone)
set(zsh zsh/vendor-completions/_touchstone)
set(fish fish/vendor_completions.d/touchstone.fish)
foreach(shell bash zsh fish)
  execute_process(COMMAND ${BIN}/touchstone completion ${shell} OUTPUT_VARIABLE text COMMAND_ERROR_IS_FATAL ANY)
  file(WRITE ${INTO}/share/${${shell}} "${text}")
endforeach()
