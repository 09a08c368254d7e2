-- Numbers figures, tables and equations by chapter ("Figure 2.3") and turns @fig:x, @tbl:x, @eq:x and @sec:x into
-- links, the same for the PDF and the HTML. A reference to nothing stops the build.

local kinds = {
  fig = "Figure",
  tbl = "Table",
  eq = "Equation",
  sec = "Section",
}
local chapter, counts, sections = 0, {}, {}
local numbers = {} -- identifier -> number as text
local left_out = {} -- chapters that are not in this report
local is_typst = FORMAT:match("typst") ~= nil

local function kind_of(identifier)
  local kind = identifier:match("^(%a+):")
  return kinds[kind] and kind or nil
end

local function assign(identifier, kind)
  counts[kind] = (counts[kind] or 0) + 1
  if identifier ~= "" and numbers[identifier] then
    error("report: two things are called " .. identifier .. ".")
  end
  local number = chapter .. "." .. counts[kind]
  numbers[identifier] = number
  return number
end

local function with_number(word, number, inlines)
  local label = pandoc.Strong({ pandoc.Str(word .. "\u{a0}" .. number .. ".") })
  local out = pandoc.Inlines({ label, pandoc.Space() })
  out:extend(inlines)
  return out
end

local function number_caption(element, word, number)
  local long = element.caption.long
  if #long == 0 then
    long = pandoc.Blocks({ pandoc.Plain({}) })
  end
  long[1].content = with_number(word, number, long[1].content)
  element.caption.long = long
  return element
end

local function numbered_equation(span, number)
  if is_typst then
    local math = pandoc.write(pandoc.Pandoc({ pandoc.Para(span.content) }), "typst")
    return pandoc.RawBlock(
      "typst",
      "#[\n#set math.equation(numbering: _ => [(" .. number .. ")])\n"
        .. math:gsub("%s+$", "") .. " <" .. span.identifier .. ">\n]"
    )
  end
  local shown = pandoc.Span(span.content, { class = "formula" })
  local tag = pandoc.Span({ pandoc.Str("(" .. number .. ")") }, { class = "number" })
  return pandoc.Div({ pandoc.Plain({ shown, tag }) }, { id = span.identifier, class = "equation" })
end

-- First walk, in reading order: count and number.
local count = {
  traverse = "topdown",
  Header = function(header)
    if header.classes:includes("unnumbered") then
      return nil
    end
    for level = header.level + 1, 6 do
      sections[level] = 0
    end
    sections[header.level] = (sections[header.level] or 0) + 1
    if header.level == 1 then
      chapter = sections[1]
      counts = {}
    end
    local parts = {}
    for level = 1, header.level do
      parts[level] = tostring(sections[level] or 0)
    end
    numbers[header.identifier] = table.concat(parts, ".")
    return nil
  end,
  Figure = function(figure)
    return number_caption(figure, "Figure", assign(figure.identifier, "fig")), false
  end,
  Table = function(element)
    local shares = element.attributes.widths or element.attr.attributes.widths
    if shares then
      local column = 0
      for share in shares:gmatch("[^,]+") do
        column = column + 1
        element.colspecs[column] = { element.colspecs[column][1], tonumber(share) }
      end
      element.attr.attributes.widths = nil
    end
    local numbered = number_caption(element, "Table", assign(element.identifier, "tbl"))
    -- On a narrow page a wide table scrolls in a frame of its own, not the page.
    return is_typst and numbered or pandoc.Div({ numbered }, { class = "table-wrap" }), false
  end,
  Para = function(paragraph)
    local span = paragraph.content[1]
    if #paragraph.content == 1 and span.t == "Span" and kind_of(span.identifier) == "eq" then
      return numbered_equation(span, assign(span.identifier, "eq")), false
    end
    return nil
  end,
}

-- Whether a label lies in a chapter that this report leaves out.
local function is_left_out(label)
  for _, name in ipairs(left_out) do
    if not numbers[label] and label:match("^%a+:(.*)$"):sub(1, #name) == name then
      return true
    end
  end
  return false
end

-- Second walk: references, and paths of images as typst wants them.
local resolve = {
  Cite = function(cite)
    local out = pandoc.Inlines({})
    for position, citation in ipairs(cite.citations) do
      local kind = kind_of(citation.id)
      if not kind then
        return nil
      end
      local number = numbers[citation.id]
      if is_left_out(citation.id) then
        return pandoc.Str("a part that this report leaves out")
      end
      if not number then
        error("report: there is nothing called " .. citation.id .. " to refer to.")
      end
      if position > 1 then
        out:insert(pandoc.Str(position == #cite.citations and " and " or ", "))
      end
      local word = (kind == "sec" and not number:find("%.")) and "Chapter" or kinds[kind]
      out:insert(pandoc.Link({ pandoc.Str(word .. "\u{a0}" .. number) }, "#" .. citation.id))
    end
    return out
  end,
  -- []{.page of="fig:x"}: the page of a label, in print.
  Span = function(span)
    if not span.classes:includes("page") then
      return nil
    end
    local of = span.attributes.of
    if not numbers[of] and not is_left_out(of) then
      error("report: there is nothing called " .. of .. " to refer to.")
    end
    if not is_typst or not numbers[of] then
      return pandoc.Inlines({})
    end
    return pandoc.RawInline("typst", "(p.~#context counter(page).at(<" .. of .. ">).first())")
  end,
  Image = function(image)
    -- A figure that moves on the page stands still in the PDF.
    if image.attributes.moving and not is_typst then
      image.src = image.attributes.moving
    end
    image.attributes.moving = nil
    if is_typst and not image.src:match("^/") then
      image.src = "/" .. image.src
    end
    return image
  end,
}

-- In print a figure or table that does not fit on the page may stand some sentences later, so that no page ends half
-- empty: metadata `later` says how many steps (`fig:a=1,tbl:b=2`). A step never cuts a sentence or passes a heading or
-- another figure. Marks say where the text before each one ends, and whether it may go further.
local function shown(block)
  return block ~= nil and (block.t == "Figure" or block.t == "Table")
end

local function step(blocks, place)
  for after = place + 1, #blocks do
    local block = blocks[after]
    if block.t ~= "Para" and block.t ~= "BulletList" and block.t ~= "OrderedList" then
      return nil
    end
    if block.t == "Para" and pandoc.utils.stringify(block):match("[.!?][)\u{201d}]?$") then
      return after
    end
  end
  return nil
end

-- The words that a block ends with: of a figure its caption, of an equation none.
local function last_words(block)
  if block.t == "Figure" then
    return block.caption.long[1] and block.caption.long[1].content
  end
  return block.t == "Para" and block.content[#block.content].t ~= "Span" and block.content or nil
end

local function spread(blocks, later)
  for at = #blocks, 1, -1 do -- from the last, so that places before it stay as they are
    local block, from = blocks[at], at
    for _ = 1, shown(block) and tonumber(later[block.identifier]) or 0 do
      local to = step(blocks, from)
      if to then
        blocks:remove(from)
        blocks:insert(to, block)
        from = to
      end
    end
  end
  local number = 0
  for position, block in ipairs(blocks) do
    if block.t == "Header" and block.level == 1 then
      number = number + 1
    end
    local before = position - 1
    while before > 0 and blocks[before].t == "Header" and blocks[before].level > 1 do
      before = before - 1
    end
    local words = before > 0 and last_words(blocks[before])
    if shown(block) and block.identifier ~= "" and words then
      local further = step(blocks, position) and "true" or "false"
      local said = '#sym.wj#box[#metadata(("%s", %s, %d))<before>]'
      words:insert(pandoc.RawInline("typst", said:format(block.identifier, further, number)))
    end
  end
  return blocks
end

function Pandoc(document)
  for name in pandoc.utils.stringify(document.meta["left-out"] or ""):gmatch("[^,]+") do
    table.insert(left_out, name)
  end
  if is_typst then
    local later = {}
    for name, steps in pandoc.utils.stringify(document.meta.later or ""):gmatch("([^,=]+)=(%d+)") do
      later[name] = steps
    end
    document.blocks = spread(document.blocks, later)
  end
  return document:walk(count):walk(resolve)
end
