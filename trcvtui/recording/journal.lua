-- The journal of a trcvtui recording in words (docs/recording-format.md); link type USER0 (DLT 147).
local journal = Proto("trcvtui", "trcvtui journal")
local MAGIC, INDEX = "trcvtui journal\n", "trcvtui index\n\0\0"
local MOST_SHOWN = 2000
local RECORDS = {
  [16] = {"Endpoint", 2}, [17] = {"Fault", 5}, [18] = {"NewClient", 2}, [19] = {"KernelLoss", 2},
  [20] = {"PathInfo", 4}, [21] = {"Datagram", 3}, [22] = {"LocalAddress", 5}, [23] = {"BenchNote", 5},
  [24] = {"DeferredWork", 4}, [25] = {"RunHeader", 10}, [26] = {"LostEntries", 2},
}
local SINGLES = {[0] = "WOULD_BLOCK", "HELD_BACK", "OPENING"}

local begun = {}  -- pieces of blocks by the number of the packet that ends them
local open_pieces = {}

function journal.init()
  begun, open_pieces = {}, {}
end

-- A block is a string; `at` counts from 0 as the page does.
local function u(text, at, size)
  local number = 0
  for i = size, 1, -1 do number = number * 256 + text:byte(at + i) end
  return number
end

local function bytes_text(text)
  local shown = text:sub(1, 32):gsub(".", function(c) return string.format("%02X ", c:byte()) end)
  return #text > 32 and (shown .. ".. " .. #text .. " bytes") or shown
end

local value
local function values(text, at, count, depth)
  local found = {}
  for i = 1, count do found[i], at = value(text, at, depth + 1) end
  return found, at
end

function value(text, at, depth)
  if depth > 8 then error("values inside values") end
  local tag = text:byte(at + 1)
  at = at + 1
  if tag == 0 then return "-", at end
  if tag == 1 then return "false", at end
  if tag == 2 then return "true", at end
  if tag == 3 then return tostring((Struct.unpack("<e", text:sub(at + 1, at + 8)))), at + 8 end
  if tag == 4 or tag == 5 then
    local size = u(text, at, 4)
    local part = text:sub(at + 5, at + 4 + size)
    at = at + 4 + size
    if tag == 4 then return part:sub(1, 400), at end
    return size > 0 and bytes_text(part) or "no bytes", at
  end
  if tag == 6 or tag == 7 then
    local count, found = u(text, at, 2), nil
    found, at = values(text, at + 2, tag == 7 and 2 * count or count, depth)
    return "(" .. table.concat(found, ", ") .. ")", at
  end
  if tag == 8 then return SINGLES[text:byte(at + 1)] or "?", at + 1 end
  if tag == 9 then
    local count, size = u(text, at, 2), 0
    for i = 0, count - 1 do size = size + u(text, at + 10 + 12 * i, 4) end
    return size .. " bytes in packets", at + 2 + 12 * count
  end
  local record = RECORDS[tag]
  if record == nil then error("tag " .. tostring(tag)) end
  local found
  found, at = values(text, at, record[2], depth)
  return record[1] .. "(" .. table.concat(found, ", ") .. ")", at
end

-- `questions`: those of the entries before in this block, by number from 1; a like question is that number.
local function entry(text, at, questions)
  local question, answer, found
  if text:byte(at + 1) == 10 then
    question = questions[u(text, at + 1, 4) + 1]
    answer, at = value(text, at + 5, 0)
  elseif text:byte(at + 1) == 6 and u(text, at + 1, 2) == 4 then
    found, at = values(text, at + 3, 4, 0)
    question, answer = found[1] .. ": " .. found[2] .. " " .. found[3], found[4]
  else
    answer, at = value(text, at, 0)
    return answer, at, ""
  end
  return question .. " -> " .. answer, at, question
end

local function show(text, tvb, tree)
  local number, unlike = u(text, 22, 4), u(text, 26, 4)
  local lines, questions, at = {}, {}, 30
  for i = 1, unlike do
    local ok, line, after, question = pcall(entry, text, at, questions)
    if not ok then
      tree:add(tvb(), "entry " .. i .. " cannot be read")
      return number, 0
    end
    lines[i], questions[i], at = line:gsub("%c", " "), question, after
  end
  local count = math.floor((#text - at) / 4)
  for i = 0, math.min(count, MOST_SHOWN) - 1 do
    tree:add(tvb(), lines[u(text, at + 4 * i, 4) + 1] or "?")
  end
  if count > MOST_SHOWN then tree:add(tvb(), (count - MOST_SHOWN) .. " more") end
  return number, count
end

function journal.dissector(tvb, pinfo, root)
  pinfo.cols.protocol = "journal"
  local tree = root:add(journal, tvb())
  if not pinfo.visited then
    if tvb:len() > 1 then open_pieces[#open_pieces + 1] = tvb:raw(1) end
    if tvb(0, 1):uint() == 0 then
      begun[pinfo.number], open_pieces = table.concat(open_pieces), {}
    end
  end
  local text = begun[pinfo.number]
  if text == nil then
    pinfo.cols.info = "a block of the journal that goes on"
    return tvb:len()
  end
  if text:sub(1, #INDEX) == INDEX then
    pinfo.cols.info = "index of " .. math.floor((#text - #INDEX - 32) / 28) .. " blocks and keyframes"
    return tvb:len()
  end
  if text:sub(1, 13) == "trcvtui state" and #text > 24 then
    pinfo.cols.info = "keyframe of scan " .. string.unpack("<I4", text, 21)
    return tvb:len()
  end
  if #text < 30 or text:sub(1, #MAGIC) ~= MAGIC then
    pinfo.cols.info = "no block of a journal"
    return tvb:len()
  end
  local number, count = show(text, tvb, tree)
  pinfo.cols.info = "block " .. number .. " of the journal: " .. count .. " entries"
  tree:append_text(", block " .. number)
  return tvb:len()
end

DissectorTable.get("wtap_encap"):add(wtap.USER0, journal)
